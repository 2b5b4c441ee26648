"""One source onto many targets on two workers, one of them killed in the middle."""

import json
import os
import pathlib
import shutil
import signal
import threading
import time

import pytest
from conftest import NET_SOURCE, NET_TARGET, sphere

import barymap

distributed = pytest.importorskip("dask.distributed")

TARGETS = 12


@pytest.fixture(scope="module")
def crowd(tmp_path_factory, checker):
    """A source with a texture, twelve targets, one of them broken."""
    folder = tmp_path_factory.mktemp("crowd")
    barymap.Mesh(*sphere(24, 12)).write(folder / "source.obj")
    barymap.write_image(folder / "skin.png", checker)
    (folder / "targets").mkdir()
    for k in range(TARGETS):
        vertices, faces, uv = sphere(18, 12, 1.0 + 0.1 * k)
        barymap.Mesh(vertices * (1, 1, 1 + 0.05 * k), faces, uv).write(folder / "targets" / f"t{k:02}.obj")
        pairs = {"source": NET_SOURCE, "target": NET_TARGET}
        (folder / "targets" / f"t{k:02}.json").write_text(json.dumps(pairs))
    (folder / "targets" / "t05.obj").write_text("v 0 0 nonsense\n")
    return folder


def words(folder, out):
    return [
        "batch", "--source", str(folder / "source.obj"), "--texture", str(folder / "skin.png"),
        "--targets", str(folder / "targets"), "--size", "256", "--landmarks", "60", "--backend", "cpu", "-o", str(out),
    ]


def files(folder):
    return {p.relative_to(folder).as_posix(): p.read_bytes() for p in sorted(folder.rglob("*")) if p.is_file()}


def test_a_killed_worker_loses_nothing(crowd, program, tmp_path):
    from barymap import cluster

    one = tmp_path / "one"
    done = program(*words(crowd, one), check=False)
    assert done.returncode == 4, "one target is broken"
    expected = files(one)
    assert len({name.split("/")[0] for name in expected}) == TARGETS - 1

    out, told, killed = tmp_path / "many", [], []
    with distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as local:
        with distributed.Client(local) as client:
            pids = client.run(os.getpid)
            begun = tmp_path / "many"

            def kill():
                # In the middle: some results are there, and others are not.
                while len(list(begun.glob("t*/item.json"))) < 2:
                    time.sleep(0.02)
                killed.append(len(list(begun.glob("t*/item.json"))))
                os.kill(next(iter(pids.values())), signal.SIGKILL)

            thread = threading.Thread(target=kill)
            thread.start()
            cache = str(tmp_path / "cache")
            result = cluster.run(client, words(crowd, out), shards=6, threads=1, cache=cache, tell=told.append)
            thread.join()
    assert killed and killed[0] < TARGETS - 1, "the worker was killed in the middle"
    assert result.given_up == [] and result.code == 4
    names = [item["name"] for item in result.items]
    assert len(names) == len(set(names)) == TARGETS, "each once"
    assert [i["name"] for i in result.items if i["status"] == "failed"] == ["t05"]
    assert files(out) == expected, "the same bytes as one process"
    assert len(told) == 6 == len(result.shards)
    assert any(pathlib.Path(cache).rglob("*")), "embeddings are in the shared cache"


def test_going_on_makes_only_what_is_missing(crowd, program, tmp_path):
    from barymap import cluster

    out = tmp_path / "out"
    with distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as local:
        with distributed.Client(local) as client:
            assert cluster.run(client, words(crowd, out), shards=2).code == 4
            first = files(out)
            shutil.rmtree(out / "t03")
            result = cluster.run(client, words(crowd, out), shards=3)
    assert files(out) == first
    status = {item["name"]: item["status"] for item in result.items}
    assert status.pop("t05") == "failed" and status.pop("t03") != "skipped"
    assert set(status.values()) == {"skipped"}


def test_frames_of_a_sequence(program, checker, tmp_path):
    from barymap import cluster

    barymap.write_image(tmp_path / "in.png", checker)
    square = [[0, 0], [96, 0], [96, 64], [0, 64]]
    moved = [[0, 0], [96, 0], [80, 50], [0, 64]]
    (tmp_path / "cage.json").write_text(json.dumps({"units": "pixel", "source": square, "target": moved}))
    (tmp_path / "one").mkdir()
    (tmp_path / "many").mkdir()
    command = lambda folder: [
        "warp", str(tmp_path / "in.png"), "--cage", str(tmp_path / "cage.json"), "--frames", "9", "--backend", "cpu",
        "-o", str(tmp_path / folder / "f.png"),
    ]
    program(*command("one"))
    with distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as local:
        with distributed.Client(local) as client:
            result = cluster.run(client, command("many"), shards=4)
    assert result.code == 0 and len(files(tmp_path / "many")) == 9
    assert files(tmp_path / "many") == files(tmp_path / "one")


def test_wrong_words_are_told_at_once(tmp_path):
    import subprocess
    import sys

    done = subprocess.run(
        [sys.executable, "-m", "barymap.cluster", "--workers", "1", "batch", "--nonsense"], capture_output=True, text=True
    )
    assert done.returncode == 2 and "--nonsense" in done.stderr
