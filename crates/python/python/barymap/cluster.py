"""Many targets, or the frames of a long clip, on the machines of a Dask cluster.

    python -m barymap.cluster [options] batch --source hero.obj --texture skin.png --targets crowd/ -o out/
    python -m barymap.cluster [options] warp in.png --cage cage.json --frames 5000 -o out/frame.png
    python -m barymap.cluster [options] animate body.glb --motion walk.c3d -o out/

The work is cut into shards (``--shard I/N`` of the command line), each of which is a process on a
worker. Without ``--scheduler`` the workers are processes of this machine; with it those of any
cluster that Dask starts (SSH, Slurm, PBS, Kubernetes). They see the same files by the same names.

- A worker that dies takes its shard with it: the process ends, and another worker does the shard
  again, up to ``--retries`` times. What was finished stays: a result appears whole or not at all,
  and one that is there is passed over.
- A bad target is told and not tried again. Exit codes are those of ``barymap batch``: 0, 4 where
  some targets failed, 3 where all did, 1 where a shard was given up.
- Run the same command again to go on after an interrupt.
- Embeddings are kept in one cache (``--cache``), which may be a shared folder; that of the source
  is made first, so that the workers do not all make it.
"""

from __future__ import annotations

import argparse
import importlib
import json
import os
import subprocess
import sys
import tempfile
import time
from typing import Any, Callable, Dict, List, NamedTuple, Optional, Sequence

#: Shards a worker, so that one that is done early takes another; each reads the source once.
SHARDS_A_WORKER = 4
#: Commands whose work can be cut.
COMMANDS = ("batch", "warp", "animate")


class Shard(NamedTuple):
    """What became of a shard: its number, where it ran, its exit code, its items and seconds."""

    number: int
    worker: str
    code: int
    items: List[Dict[str, Any]]
    error: str


class Result(NamedTuple):
    """What became of all: shards in their order, and the sentences of those that were given up."""

    shards: List[Shard]
    given_up: List[str]

    @property
    def items(self) -> List[Dict[str, Any]]:
        """Items of a batch, by name."""
        return sorted((i for s in self.shards for i in s.items), key=lambda i: str(i["name"]))

    @property
    def code(self) -> int:
        """The exit code."""
        if self.given_up:
            return 1
        wrong = [s.code for s in self.shards if s.code not in (0, 3, 4)]
        if wrong:
            return wrong[0]
        failed = [i for i in self.items if i["status"] == "failed"]
        return 0 if not failed else 3 if len(failed) == len(self.items) else 4


def _distributed() -> Any:
    """Dask, which the package does without elsewhere."""
    try:
        return importlib.import_module("dask.distributed")
    except ImportError:
        raise ImportError("Dask is not installed: pip install 'dask[distributed]'") from None


def _program() -> List[str]:
    """The command line: the program that ``BARYMAP`` names, or this package."""
    named = os.environ.get("BARYMAP")
    return [named] if named else [sys.executable, "-m", "barymap"]


def run_shard(number: int, count: int, arguments: Sequence[str], environment: Dict[str, str]) -> Shard:
    """Does one shard; raises where another try may help."""
    with tempfile.TemporaryDirectory() as folder:
        report = os.path.join(folder, "report.json")
        more = ["--quiet", "--shard", f"{number}/{count}", "--report", report]
        # It ends when this process does: a worker that is killed leaves none behind.
        done = subprocess.run(
            [*_program(), *arguments, *more],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            text=True,
            env={**os.environ, **environment},
            check=False,
        )
        told = done.stderr.strip()[-1000:]
        if done.returncode not in (0, 2, 3, 4):
            raise RuntimeError(f"shard {number}/{count}: exit {done.returncode}: {told}")
        items: List[Dict[str, Any]] = []
        if os.path.exists(report):
            with open(report, encoding="utf-8") as file:
                items = json.load(file).get("items", [])
    return Shard(number, str(_distributed().get_worker().name), done.returncode, items, told)


def _embed(arguments: Sequence[str], environment: Dict[str, str]) -> None:
    """Makes the source's embedding, which every shard of a batch reads."""
    parser = argparse.ArgumentParser(add_help=False, allow_abbrev=False)
    for option in ("--source", "--landmarks", "--sampling", "--dimension", "--weld"):
        parser.add_argument(option)
    known, _ = parser.parse_known_args(list(arguments))
    if known.source is None:
        return
    more = [w for o, v in vars(known).items() if v is not None and o != "source" for w in (f"--{o}", v)]
    words = [*_program(), "embed", known.source, "-o", os.devnull, "--quiet", *more]
    # What is wrong with the source is told by the shards.
    subprocess.run(
        words, stdin=subprocess.DEVNULL, capture_output=True, env={**os.environ, **environment}, check=False
    )


def run(
    client: Any,
    arguments: Sequence[str],
    *,
    shards: Optional[int] = None,
    retries: int = 2,
    threads: Optional[int] = None,
    cache: Optional[str] = None,
    tell: Callable[[Shard], object] = lambda shard: None,
) -> Result:
    """Does the work of a command line on the workers of a ``dask.distributed.Client``.

    arguments : those of ``barymap batch``, ``warp`` or ``animate``, the command first
    shards : into how many parts; four a worker without
    retries : how often a shard is done again whose worker died
    threads : of each process; the cores of a worker's machine shared between its workers without
    cache : folder of the embeddings
    tell : called with each shard that is done
    """
    distributed = _distributed()
    if not arguments or arguments[0] not in COMMANDS:
        raise ValueError(f"the command is one of {', '.join(COMMANDS)}")
    workers = client.scheduler_info(n_workers=-1)["workers"]
    count = shards or SHARDS_A_WORKER * max(1, len(workers))
    environment = {} if cache is None else {"BARYMAP_CACHE": cache}
    if threads is None:
        threads = max(1, (os.cpu_count() or 1) // max(1, len(workers)))
    environment["RAYON_NUM_THREADS"] = str(threads)
    if arguments[0] == "batch":
        client.submit(_embed, list(arguments[1:]), environment, pure=False).result()
    futures = {
        client.submit(run_shard, k, count, list(arguments), environment, retries=retries, pure=False): k
        for k in range(1, count + 1)
    }
    done: List[Shard] = []
    given_up: List[str] = []
    for future in distributed.as_completed(list(futures)):
        if future.status == "finished":
            shard = Shard(*future.result())
            done.append(shard)
            tell(shard)
        else:
            given_up.append(f"shard {futures[future]}/{count}: {future.exception()}")
    return Result(sorted(done, key=lambda shard: shard.number), given_up)


def main(words: Optional[Sequence[str]] = None) -> int:
    """The program; returns its exit code."""
    parser = argparse.ArgumentParser(
        prog="python -m barymap.cluster", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--scheduler", help="address of a Dask scheduler; without it workers of this machine")
    parser.add_argument("--workers", type=int, default=2, help="workers of this machine (default 2)")
    parser.add_argument("--shards", type=int, help="parts of the work (default: four a worker)")
    parser.add_argument("--threads", type=int, help="threads of a process (default: the cores over the workers)")
    parser.add_argument("--retries", type=int, default=2, help="times a shard is done again (default 2)")
    parser.add_argument("--cache", help="folder of the embeddings, shared by all workers")
    parser.add_argument("--report", help="write what became of all items here (JSON)")
    parser.add_argument("command", choices=COMMANDS)
    parser.add_argument("arguments", nargs=argparse.REMAINDER, help="of the command line")
    given = parser.parse_args(words)

    def tell(shard: Shard) -> None:
        names = [f"{i['name']}: {i['status']}" for i in shard.items]
        print(f"shard {shard.number} on worker {shard.worker}: {', '.join(names) or 'done'}", flush=True)

    distributed = _distributed()
    cluster = given.scheduler
    if cluster is None:
        cluster = distributed.LocalCluster(n_workers=given.workers, threads_per_worker=1, dashboard_address=None)
    begun = time.perf_counter()
    with distributed.Client(cluster) as client:
        workers = len(client.scheduler_info(n_workers=-1)["workers"])
        result = run(
            client,
            [given.command, *given.arguments],
            shards=given.shards,
            retries=given.retries,
            threads=given.threads,
            cache=given.cache,
            tell=tell,
        )
    seconds = time.perf_counter() - begun
    if given.scheduler is None:
        cluster.close()
    made = sum(item["status"] not in ("failed", "skipped") for item in result.items)
    each = f": {60 * made / seconds:.1f} targets a minute" if made else ""
    print(f"{len(result.shards)} shards on {workers} workers in {seconds:.1f} s{each}", flush=True)
    for item in result.items:
        if item["status"] == "failed":
            print(f"{item['name']}: {item.get('error')}", file=sys.stderr)
    for sentence in [*result.given_up, *(s.error for s in result.shards if s.code == 2)]:
        print(sentence, file=sys.stderr)
    if given.report is not None:
        with open(given.report, "w", encoding="utf-8") as file:
            json.dump({"items": result.items, "given_up": result.given_up}, file, indent=2)
    return result.code


if __name__ == "__main__":
    # By its name in the package, so that workers find what they are sent.
    from barymap.cluster import main as program

    sys.exit(program())
