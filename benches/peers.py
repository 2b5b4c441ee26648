#!/usr/bin/env python3
"""Times `barymap transfer` beside pymeshlab's attribute transfer on the same files, as whole processes.

    cargo build --release && BARYMAP_DATA=... python3 benches/peers.py

pymeshlab is taken as it is installed, or put into a virtual environment in the target folder. Both write a texture of
2048 x 2048 for human_male from human_female; pymeshlab takes the closest point in space (it knows no anchors), as the rows
`closest` and `rbf` of `cargo bench --bench accuracy` do, which tell how far off that is. The embeddings are kept by a first
run. Prints medians of three.
"""

import json
import os
import pathlib
import platform
import statistics
import subprocess
import sys
import tempfile
import time
import venv

ROOT = pathlib.Path(__file__).resolve().parent.parent
TARGET = pathlib.Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target"))
SIZE = 2048
RUNS = 3

PEER = """
import sys
import pymeshlab

source, target, folder, size = sys.argv[1:]
meshes = pymeshlab.MeshSet()
meshes.load_new_mesh(source)
meshes.load_new_mesh(target)
meshes.transfer_attributes_to_texture_per_vertex(
    sourcemesh=0,
    targetmesh=1,
    attributeenum="Texture Color",
    upperbound=pymeshlab.PercentageValue(100),
    textname="peer.png",
    textw=int(size),
    texth=int(size),
)
meshes.set_current_mesh(1)
meshes.save_current_mesh(folder + "/peer.obj")
"""


def interpreter():
    """A Python that can import pymeshlab."""
    for python in [sys.executable, str(TARGET / "peers" / "venv" / "bin" / "python")]:
        if os.path.exists(python) and subprocess.run([python, "-c", "import pymeshlab"], capture_output=True).returncode == 0:
            return python
    folder = TARGET / "peers" / "venv"
    venv.create(folder, with_pip=True)
    python = str(folder / "bin" / "python")
    subprocess.run([python, "-m", "pip", "install", "--quiet", "pymeshlab"], check=True)
    return python


def run(command):
    """Wall seconds, and CPU seconds / 2, of a process and what it starts."""
    start = time.perf_counter()
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
    output = process.stdout.read().decode(errors="replace")
    _, status, usage = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode != 0:
        sys.exit(f"{command[0]} failed:\n{output}")
    return time.perf_counter() - start, (usage.ru_utime + usage.ru_stime) / 2


def medians(command):
    """Medians of a few runs."""
    return [statistics.median(times) for times in zip(*(run(command) for _ in range(RUNS)))]


def main():
    """Runs everything and prints a table."""
    data = os.environ.get("BARYMAP_DATA")
    if not data:
        sys.exit("Set BARYMAP_DATA to the folder of real models")
    data = pathlib.Path(data)
    program = TARGET / "release" / ("barymap.exe" if os.name == "nt" else "barymap")
    if not program.exists():
        sys.exit(f"{program} is missing: run cargo build --release")
    source = str(data / "textured/human_female/human_female.obj")
    target = str(data / "textured/human_male/human_male.obj")
    anchors = str(data / "gt/makehuman_same/anchors_80.txt")
    python = interpreter()
    version = subprocess.run(
        [python, "-c", "import importlib.metadata as m; print(m.version('pymeshlab'))"], capture_output=True, text=True, check=True
    ).stdout.strip()
    ours = subprocess.run([program, "--version"], capture_output=True, text=True, check=True).stdout.strip()
    print(f"{ours}; pymeshlab {version}, Python {platform.python_version()}; {SIZE} x {SIZE}, medians of {RUNS}, whole processes")
    with tempfile.TemporaryDirectory() as folder:
        peer = medians([python, "-c", PEER, source, target, folder, str(SIZE)])
        if not (pathlib.Path(folder) / "peer.png").exists():
            sys.exit(f"pymeshlab wrote no texture: {sorted(os.listdir(folder))}")
        print("| program | wall, s | CPU / 2, s | wall / pymeshlab | CPU / pymeshlab |")
        print("|---|---|---|---|---|")
        print(f"| pymeshlab | {peer[0]:.2f} | {peer[1]:.2f} | 1 | 1 |")
        for backend in ["cpu", "gpu"]:
            report = os.path.join(folder, "report.json")
            command = [str(program), "transfer", "--source", source, "--target", target, "--anchors", anchors]
            command += ["--size", str(SIZE), "--backend", backend, "--quiet", "--report", report]
            command += ["--output", os.path.join(folder, "ours.png")]
            if backend == "gpu" and subprocess.run([program, "devices"], capture_output=True).returncode != 0:
                continue
            run(command)
            wall, cpu = medians(command)
            with open(report, encoding="utf-8") as file:
                stages = {name: round(s, 2) for name, s in json.load(file)["seconds"].items()}
            print(f"| barymap --backend {backend} | {wall:.2f} | {cpu:.2f} | {wall / peer[0]:.2f} | {cpu / peer[1]:.2f} |")
            print(f"<!-- stages of the last run, wall seconds: {json.dumps(stages)} -->")


if __name__ == "__main__":
    main()
