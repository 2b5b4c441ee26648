"""A folder of targets to try `barymap batch` and `python -m barymap.cluster` on.

    python examples/crowd.py FOLDER COUNT [TIMES]

The target of `barymap demo` in COUNT proportions, each with its pairs beside it; the source and its texture in FOLDER itself. TIMES
cuts every triangle into four so many times: once makes meshes of 28,000 vertices. Needs the wheel of tests/python.sh.
"""

import json
import pathlib
import subprocess
import sys

import numpy as np

import barymap


def refined(mesh):
    """Vertices, faces and texture coordinates with every triangle cut into four."""
    vertices, faces, uv = mesh.vertices, mesh.faces.astype(np.int64), mesh.uv
    sides = np.sort(faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    edges, number = np.unique(sides, axis=0, return_inverse=True)
    middle = number.reshape(-1, 3) + len(vertices)
    points = np.concatenate([vertices, vertices[edges].mean(axis=1)])
    half = (uv + np.roll(uv, -1, axis=1)) / 2
    a, b, c = faces.T
    ab, bc, ca = middle.T
    cut = [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]
    places = [
        (uv[:, 0], half[:, 0], half[:, 2]), (half[:, 0], uv[:, 1], half[:, 1]),
        (half[:, 2], half[:, 1], uv[:, 2]), (half[:, 0], half[:, 1], half[:, 2]),
    ]
    return points, np.concatenate([np.stack(t, 1) for t in cut]), np.concatenate([np.stack(p, 1) for p in places])


def main():
    if len(sys.argv) not in (3, 4):
        sys.exit(__doc__)
    folder, count = pathlib.Path(sys.argv[1]), int(sys.argv[2])
    times = int(sys.argv[3]) if len(sys.argv) > 3 else 0
    (folder / "targets").mkdir(parents=True, exist_ok=True)
    subprocess.run([sys.executable, "-m", "barymap", "demo", "--size", "512", "-q", "-o", str(folder / "demo")], check=True)
    source, target = (barymap.read(folder / "demo" / f"{name}.obj") for name in ("source", "target"))
    # By position, which refinement does not change.
    on_source, on_target = barymap.Map(source, target, folder / "demo" / "pairs.json", method="closest").anchors
    at = lambda mesh, p: np.einsum("nk,nkj->nj", p.barycentric, mesh.vertices[mesh.faces[p.faces]])
    places = {"source": at(source, on_source), "target": at(target, on_target)}
    for _ in range(times):
        source, target = (barymap.Mesh(*refined(mesh)) for mesh in (source, target))
    source.write(folder / "source.obj")
    barymap.write_image(folder / "skin.png", barymap.read_image(folder / "demo" / "source_texture.png"))
    for k in range(count):
        scale = np.array([1 + 0.02 * (k % 7), 1 + 0.015 * (k % 11), 1 + 0.01 * (k % 5)])
        target.with_vertices(target.vertices * scale).write(folder / "targets" / f"t{k:04}.obj")
        lists = {"source": places["source"], "target": places["target"] * scale}
        text = {side: [{"position": p} for p in points.tolist()] for side, points in lists.items()}
        (folder / "targets" / f"t{k:04}.json").write_text(json.dumps(text))
    print(f"{folder}: {count} targets of {len(target.vertices)} vertices")


if __name__ == "__main__":
    main()
