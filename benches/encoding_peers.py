#!/usr/bin/env python3
"""Poses a bumpy tube with `barymap deform` and with libigl's as-rigid-as-possible deformation, from the same handles.

    python3 benches/encoding_peers.py [PICTURE.png]

Prints G of the encoding (the diagonal being one), edge lengths, flipped triangles, volume and seconds of CPU time / 2, and draws the results: above as-rigid-as-possible
(spokes, 100 iterations from rest), then plain encoding, below with a stiffness. libigl is taken as it is installed, or put into a virtual environment in the
target folder.
"""

import json
import os
import pathlib
import subprocess
import sys
import tempfile
import venv

ROOT = pathlib.Path(__file__).resolve().parent.parent
TARGET = pathlib.Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target"))
BARYMAP = TARGET / "release" / "barymap"
NEEDS = ["igl", "numpy", "PIL"]
AROUND, RINGS = 40, 90
POSES = [("twist", 90), ("bend", 120), ("twist", 180)]


def with_packages():
    """Starts this file again in a Python that has the packages."""
    imports = "import " + ", ".join(NEEDS)
    for python in [sys.executable, str(TARGET / "peers" / "igl" / "bin" / "python")]:
        if os.path.exists(python) and subprocess.run([python, "-c", imports], capture_output=True).returncode == 0:
            return python
    folder = TARGET / "peers" / "igl"
    venv.create(folder, with_pip=True)
    python = str(folder / "bin" / "python")
    subprocess.run([python, "-m", "pip", "install", "--quiet", "libigl", "numpy", "pillow"], check=True)
    return python


def tube(np):
    """Positions and triangles of an open tube with bumps, along x, its diagonal one."""
    z, u = np.meshgrid(np.linspace(0, 4, RINGS), np.arange(AROUND) * 2 * np.pi / AROUND, indexing="ij")
    r = 0.5 * (1 + 0.08 * np.cos(3 * u) * np.sin(2.5 * z) + 0.05 * np.sin(5 * z + 2 * u))
    v = np.stack([z - 2, r * np.cos(u), r * np.sin(u)], axis=-1).reshape(-1, 3)
    v /= np.linalg.norm(v.max(0) - v.min(0))
    j, i = np.meshgrid(np.arange(RINGS - 1), np.arange(AROUND), indexing="ij")
    a, b = j * AROUND + i, j * AROUND + (i + 1) % AROUND
    c, d = a + AROUND, b + AROUND
    return v, np.concatenate([np.stack(t, -1).reshape(-1, 3) for t in [(a, c, b), (b, c, d)]]).astype(np.int64)


def posed(np, p, kind, degrees):
    """Where the far end goes."""
    half, angle = p[:, 0].max(), np.radians(degrees)
    c, s = np.cos(angle), np.sin(angle)
    if kind == "twist":
        return p @ np.array([[1, 0, 0], [0, c, -s], [0, s, c]]).T
    r = 2 * half / angle
    turned = (p - [half, 0, 0]) @ np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]).T
    return turned + [r * s - half, r * (1 - c), 0]


def ours(np, folder, handles, targets, options):
    """Positions, report and picture of `barymap deform`."""
    entries = [{"vertex": int(v), "position": list(map(float, p))} for v, p in zip(handles, targets)]
    (folder / "h.json").write_text(json.dumps({"handles": entries}))
    command = [BARYMAP, "deform", "m.obj", "--handles", "h.json", "-o", "o.obj", "--report", "r.json", "--no-cache", "--quiet"]
    subprocess.run(command + options, cwd=folder, check=True, stderr=subprocess.DEVNULL)
    view = ["--view", "0,15", "--size", "420x260"]
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    subprocess.run([BARYMAP, "render", "o.obj", *view, "-o", "o.png"], cwd=folder, check=True, **quiet)
    report = json.loads((folder / "r.json").read_text())
    lines = [line.split()[1:4] for line in (folder / "o.obj").read_text().splitlines() if line.startswith("v ")]
    return np.array(lines, dtype=float), report


def main():
    import time

    import igl
    import numpy as np
    from PIL import Image

    output = sys.argv[1] if len(sys.argv) > 1 else str(TARGET / "encoding_peers.png")
    v, f = tube(np)
    handles = np.where(abs(v[:, 0]) > 0.92 * v[:, 0].max())[0]
    sheet = Image.new("RGB", (420 * len(POSES), 260 * 3), "white")
    print("| pose | method | G | edges, rms | edges, most | flipped | CPU s / 2 |\n|---|---|---|---|---|---|---|")
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        lines = [f"v {a!r} {b!r} {c!r}" for a, b, c in v.tolist()] + [f"f {a + 1} {b + 1} {c + 1}" for a, b, c in f.tolist()]
        (folder / "m.obj").write_text("\n".join(lines) + "\n")
        for column, (kind, degrees) in enumerate(POSES):
            targets = np.where(v[handles, :1] > 0, posed(np, v, kind, degrees)[handles], v[handles])
            start = time.process_time()
            data = igl.ARAPData()
            data.energy = igl.ARAP_ENERGY_TYPE_SPOKES
            data.max_iter = 100
            igl.arap_precomputation(v, f, 3, handles.astype(np.int32), data)
            rigid = igl.arap_solve(np.ascontiguousarray(targets), data, v.copy())
            seconds = (time.process_time() - start) / 2
            # With every vertex held, the report measures the shape that is given.
            _, report = ours(np, folder, np.arange(len(v)), rigid, [])
            rows = [("as rigid as possible", report, seconds, Image.open(folder / "o.png").convert("RGB"))]
            for label, options in [("encoding", []), ("encoding, stiffness 1", ["--stiffness", "1"])]:
                _, report = ours(np, folder, handles, targets, options)
                rows.append((label, report, sum(report["cpu_seconds"].values()) / 2, Image.open(folder / "o.png").convert("RGB")))
            for k, (label, report, seconds, picture) in enumerate(rows):
                sheet.paste(picture, (420 * column, 260 * k))
                g, rms, most = report["g"], report["edge_rms"], report["edge_max"]
                print(f"| {kind} {degrees} | {label} | {g:.1e} | {rms:.3f} | {most:.2f} | {report['flipped']} | {seconds:.2f} |")
    sheet.save(output)
    print(output)


if __name__ == "__main__":
    python = with_packages()
    if python != sys.executable:
        sys.exit(subprocess.run([python, __file__, *sys.argv[1:]]).returncode)
    main()
