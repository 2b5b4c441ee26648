#!/usr/bin/env python3
"""How far maps between meshes are from the truth: Blender's Data Transfer beside the methods of `barymap map`.

    cargo build --release && BARYMAP_DATA=... python3 benches/blender_peer.py

Blender is the module `bpy`, taken as it is installed or put into a virtual environment in the target folder (it wants the Python it was built for; for 4.5 that is 3.11). It carries a
colour of the source's vertices, their place, by "Nearest Face Interpolated"; there is no way to tell it anchors. Pairs have vertices in common, so that the truth is known. Errors are
distances on the source over the square root of its area, at all vertices; anchors are those in BARYMAP_DATA. Wall seconds are whole processes, embeddings kept.
"""

import csv
import math
import os
import pathlib
import statistics
import subprocess
import sys
import tempfile
import time
import venv

ROOT = pathlib.Path(__file__).resolve().parent.parent
TARGET = pathlib.Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target"))

BLENDER = """
import sys
import bpy

source, target, out = sys.argv[-3:]
bpy.ops.wm.read_factory_settings(use_empty=True)


def load(path):
    vertices, faces = [], []
    for line in open(path):
        words = line.split()
        if words[:1] == ["v"]:
            vertices.append([float(w) for w in words[1:4]])
        elif words[:1] == ["f"]:
            faces.append([int(w.split("/")[0]) - 1 for w in words[1:]])
    mesh = bpy.data.meshes.new(path)
    mesh.from_pydata(vertices, [], faces)
    thing = bpy.data.objects.new(path, mesh)
    bpy.context.collection.objects.link(thing)
    return thing, vertices


(a, places), (b, _) = load(source), load(target)
low = [min(p[k] for p in places) for k in range(3)]
size = max(max(p[k] for p in places) - low[k] for k in range(3))
colour = a.data.color_attributes.new("place", "FLOAT_COLOR", "POINT")
for v, p in enumerate(places):
    colour.data[v].color = [(p[k] - low[k]) / size for k in range(3)] + [1.0]
b.data.color_attributes.new("place", "FLOAT_COLOR", "POINT")
modifier = b.modifiers.new("carry", "DATA_TRANSFER")
modifier.object = a
modifier.use_vert_data = True
modifier.data_types_verts = {"COLOR_VERTEX"}
modifier.vert_mapping = "POLYINTERP_NEAREST"
seen = b.evaluated_get(bpy.context.evaluated_depsgraph_get()).data
with open(out, "w") as file:
    for c in seen.color_attributes["place"].data:
        print(*[low[k] + size * c.color[k] for k in range(3)], file=file)
"""


def vertices_and_area(path):
    """The vertices of an OBJ file and the area of its faces."""
    vertices, area = [], 0.0
    for line in open(path, encoding="utf-8"):
        words = line.split()
        if words[:1] == ["v"]:
            vertices.append([float(w) for w in words[1:4]])
        elif words[:1] == ["f"]:
            corners = [vertices[int(w.split("/")[0]) - 1] for w in words[1:]]
            for b, c in zip(corners[1:], corners[2:]):
                p = [b[k] - corners[0][k] for k in range(3)]
                q = [c[k] - corners[0][k] for k in range(3)]
                n = [p[1] * q[2] - p[2] * q[1], p[2] * q[0] - p[0] * q[2], p[0] * q[1] - p[1] * q[0]]
                area += 0.5 * math.sqrt(sum(x * x for x in n))
    return vertices, area


def interpreter():
    """A Python that can import bpy."""
    def able(python):
        return os.path.exists(python) and subprocess.run([python, "-c", "import bpy"], capture_output=True).returncode == 0

    folder = TARGET / "peers" / "blender"
    for python in [os.environ.get("BLENDER_PYTHON", ""), sys.executable, str(folder / "bin" / "python")]:
        if python and able(python):
            return python
    venv.create(folder, with_pip=True)
    python = str(folder / "bin" / "python")
    subprocess.run([python, "-m", "pip", "install", "--quiet", "bpy==4.5.*"], check=True)
    return python


def timed(command):
    """Wall seconds of a process."""
    start = time.perf_counter()
    done = subprocess.run(command, capture_output=True, text=True)
    if done.returncode != 0:
        sys.exit(f"{command[0]} failed:\n{done.stdout}{done.stderr}")
    return time.perf_counter() - start


def main():
    """Runs everything and prints a table."""
    data = os.environ.get("BARYMAP_DATA")
    if not data:
        sys.exit("Set BARYMAP_DATA to the folder of real models")
    data = pathlib.Path(data)
    program = TARGET / "release" / ("barymap.exe" if os.name == "nt" else "barymap")
    if not program.exists():
        sys.exit(f"{program} is missing: run cargo build --release")
    python = interpreter()
    version = subprocess.run([python, "-c", "import bpy; print(bpy.app.version_string)"], capture_output=True, text=True, check=True)
    print(f"Blender {version.stdout.strip().splitlines()[-1]}")
    print("| pair | program | mean | 95 % | largest | wall, s |\n|---|---|---|---|---|---|")
    for name, source, target, anchors in [
        ("woman to man", "textured/human_female/human_female.obj", "textured/human_male/human_male.obj", "gt/makehuman_same/anchors_80.txt"),
        ("fox, running to rest", "gt/fox_same/fox_run.obj", "gt/fox_same/fox_rest.obj", "gt/fox_same/anchors_80.txt"),
    ]:
        source, target, anchors = (str(data / f) for f in (source, target, anchors))
        truth, area = vertices_and_area(source)

        def row(who, places, wall):
            errors = sorted(math.dist(p, q) / math.sqrt(area) if p else 1.0 for p, q in zip(places, truth))
            print(f"| {name} | {who} | {statistics.fmean(errors):.4f} | {errors[int(0.95 * (len(errors) - 1))]:.4f} | {errors[-1]:.3f} | {wall:.1f} |")

        with tempfile.TemporaryDirectory() as folder:
            out = os.path.join(folder, "places.txt")
            wall = timed([python, "-c", BLENDER, source, target, out])
            row("Blender, Data Transfer", [[float(w) for w in line.split()] for line in open(out, encoding="utf-8")], wall)
            for method in [["closest"], ["rbf"], ["rbf", "--relax"], ["averages"], ["transport"], ["field"]]:
                out = os.path.join(folder, "map.csv")
                command = [str(program), "map", "--source", source, "--target", target, "--anchors", anchors]
                command += ["--quiet", "-o", out, "--method", *method]
                timed(command)
                wall = timed(command)
                with open(out, encoding="utf-8") as file:
                    rows = list(csv.DictReader(file))
                places = [[float(r[k]) for k in "xyz"] if r["x"] else None for r in rows]
                row("barymap " + " ".join(method), places, wall)


if __name__ == "__main__":
    main()
