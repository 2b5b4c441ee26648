"""Threads, progress, Ctrl-C, memory."""

import os
import signal
import subprocess
import sys
import textwrap
import threading
import time

import numpy as np
import pytest

import barymap


def test_other_threads_run_meanwhile(demo):
    ticks, end = [], threading.Event()

    def tick():
        while not end.is_set():
            ticks.append(time.perf_counter())
            time.sleep(0.002)

    thread = threading.Thread(target=tick)
    thread.start()
    begun = len(ticks)
    barymap.Map(demo / "source.obj", demo / "target.obj", demo / "pairs.json", landmarks=300, cache=False, backend="cpu")
    end.set()
    thread.join()
    assert len(ticks) - begun > 20, "with the lock held there would be one or two"


def test_progress_is_told_in_the_thread_that_calls(demo):
    told = []
    here = threading.get_ident()

    def progress(stage, done, total):
        assert threading.get_ident() == here
        told.append((stage, done, total))

    barymap.Map(
        demo / "source.obj", demo / "target.obj", demo / "pairs.json", landmarks=300, cache=False, progress=progress
    )
    assert len({stage for stage, _, _ in told}) >= 2
    assert all(0 <= done and 0 <= total for _, done, total in told)
    tqdm = pytest.importorskip("tqdm")
    with open(os.devnull, "w") as nowhere:
        bar = tqdm.tqdm(file=nowhere)
        made = barymap.Map(demo / "source.obj", demo / "target.obj", demo / "pairs.json", landmarks=310, progress=bar)
        made.transfer(demo.joinpath("source_texture.png").as_posix(), size=256, progress=bar)
        assert bar.n > 0


def test_what_progress_raises_stops_the_work(demo):
    class Enough(Exception):
        pass

    calls = []

    def progress(*told):
        calls.append(told)
        raise Enough(told)

    with pytest.raises(Enough):
        barymap.Map(
            demo / "source.obj", demo / "target.obj", demo / "pairs.json", landmarks=1500, cache=False, progress=progress
        )
    assert len(calls) == 1
    # The package is as good as before.
    made = barymap.Map(demo / "source.obj", demo / "target.obj", demo / "pairs.json", landmarks=200)
    assert made.report["valid_fraction"] > 0.5


JOBS = {
    "map": "barymap.Map(source, target, pairs, landmarks=2500, cache=False, backend='cpu')",
    "transfer": "ready.transfer(texture, size=8192, supersample=2)",
    "warp": "barymap.warp(np.zeros((6000, 6000, 3), np.uint8), cage, moved, certify=True, partition='continuous')",
    "anchors": "barymap.anchors(source, target, landmarks=2500, cache=False)",
    "morph": "barymap.Encoding(source).morph([source.vertices * (1, 2, 1)], frames=400)",
    "unwrap": "[barymap.unwrap(source) for _ in range(100)]",
}


@pytest.mark.parametrize("job", JOBS)
def test_ctrl_c_ends_the_work(demo, job):
    """The interpreter gets the signal while the library works, and the work does not go on to its
    end: an exception that comes then has a note. How long it takes is printed, not asserted."""
    script = textwrap.dedent(
        f"""
        import sys, time, threading, os, signal
        import numpy as np, barymap
        os.chdir({str(demo)!r})
        source, target = barymap.read("source.obj"), barymap.read("target.obj")
        pairs, texture = "pairs.json", barymap.read_image("source_texture.png")
        ready = barymap.Map(source, target, pairs, landmarks=200) if {job!r} == "transfer" else None
        corner = [(x, y) for x, y in ((0, 0), (1, 0), (1, 1), (0, 1))]
        cage = [[6000 * x, 6000 * y] for x, y in corner]
        cage = [p for a, b in zip(cage, cage[1:] + cage[:1]) for p in np.linspace(a, b, 30)[:-1].tolist()]
        moved = [[x + 300 * np.sin(y / 900), y + 300 * np.sin(x / 700)] for x, y in cage]
        sent = []
        def send():
            sent.append(time.perf_counter())
            os.kill(os.getpid(), signal.SIGINT)
        threading.Timer(0.6, send).start()
        try:
            {JOBS[job]}
        except KeyboardInterrupt as error:
            print("late", time.perf_counter() - sent[0], *getattr(error, "__notes__", []))
        else:
            print("done")
        """
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, timeout=300)
    assert done.stdout.startswith("late"), done.stdout + done.stderr
    assert "ended by itself" not in done.stdout
    print(f"{job}: {1000 * float(done.stdout.split()[1]):.0f} ms after the signal")


def test_an_exception_that_comes_too_late_says_so(small, checker):
    def progress(stage, done, total):
        raise StopIteration

    # So short that the callback has its first turn when all is done; on a busy machine not always.
    notes = []
    for _ in range(200):
        with pytest.raises(StopIteration) as caught:
            small.transfer(checker, size=16, margin=0, progress=progress)
        notes = getattr(caught.value, "__notes__", [])
        if notes:
            break
    assert notes == ["barymap: the work had ended by itself"]


def test_memory_is_steady_over_a_thousand_transfers(small, checker):
    psutil = pytest.importorskip("psutil")
    process = psutil.Process()

    def times(count):
        for _ in range(count):
            small.transfer(checker, size=32, margin=2)

    times(200)
    before = process.memory_info().rss
    times(1000)
    grown = process.memory_info().rss - before
    # A leak of one result (4 kB of picture and as much beside it) each time would be 8 MB.
    assert grown < 4 << 20, grown
    kept = [small.transfer(checker, size=512, margin=2) for _ in range(30)]
    assert process.memory_info().rss - before > 4 << 20, "the measure sees what is kept"
    assert len(kept) == 30


def test_a_signal_is_heard_between_calls_only_once(small, checker):
    # No handler of the command line is left in the process.
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
    assert small.transfer(np.asarray(checker), size=32).valid_fraction > 0
