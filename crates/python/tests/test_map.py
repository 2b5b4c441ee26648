"""Maps, transfers and data of vertices; the command line gives the same bytes."""

import csv
import json
import pathlib
import re

import numpy as np
import pytest
from conftest import NET_SOURCE, NET_TARGET, PAIRS

import barymap


def test_points_go_where_theory_says(spheres, small):
    source, target, _ = spheres
    images = small.vertices()
    assert (images.status == barymap.VALID).mean() > 0.9
    # The spheres differ by size alone: a point goes to the one in its direction.
    at = small.vertex_positions()
    direction = target.vertices / 2.0
    off = np.linalg.norm(at - direction, axis=1)
    assert np.median(off) < 0.06, np.median(off)
    wrong = np.linalg.norm(at[::-1] - direction, axis=1)
    assert np.median(wrong) > 0.5, "the comparison sees a wrong map"
    # Anchors are met.
    assert np.allclose(at[NET_TARGET], source.vertices[NET_SOURCE], atol=1e-5)
    assert small.report["anchors"] == len(PAIRS) and small.report["method"] == "field"


def test_apply_is_the_map_of_vertices(spheres, small):
    _, target, _ = spheres
    faces = target.faces
    first = np.full(len(faces), -1)
    vertices = small.vertices()
    ids = np.arange(len(faces))
    images = small.apply(ids, np.tile([1.0, 0, 0], (len(ids), 1)))
    corner = faces[ids, 0]
    source = spheres[0]
    at = lambda i: np.einsum("nk,nkj->nj", i.barycentric, source.vertices[source.faces[i.faces]])
    assert np.allclose(at(images), at(vertices)[corner], atol=1e-5)
    assert first.shape == images.faces.shape and images.status.dtype == np.uint8


def test_the_inverse_goes_back(spheres, small):
    source, target, _ = spheres
    images, residuals = small.inverse()
    assert len(images.faces) == len(source.vertices)
    there = images.faces >= 0
    at = np.einsum("nk,nkj->nj", images.barycentric, target.vertices[target.faces[images.faces]])
    assert np.nanmedian(residuals) < 1e-3
    off = np.linalg.norm(at - 2 * source.vertices, axis=1)[there]
    assert np.median(off) < 0.12


def test_all_forms_of_anchors_are_one(spheres):
    source, target, pairs = spheres
    corner = lambda mesh, v: tuple(int(i[0]) for i in np.nonzero(mesh.faces == v))
    surface = []
    for mesh, ids in ((source, NET_SOURCE), (target, NET_TARGET)):
        places = [corner(mesh, v) for v in ids]
        surface.append(([f for f, _ in places], [np.eye(3)[k] for _, k in places]))
    forms = [
        pairs,
        pairs.tolist(),
        (NET_SOURCE, NET_TARGET),
        (source.vertices[NET_SOURCE], target.vertices[NET_TARGET]),
        tuple((np.array(f), np.array(b)) for f, b in surface),
        {"source": NET_SOURCE, "target": [{"position": target.vertices[v].tolist()} for v in NET_TARGET]},
    ]
    first = None
    for form in forms:
        made = barymap.Map(source, target, form, landmarks=60, method="rbf", backend="cpu")
        at = made.vertex_positions()
        first = at if first is None else first
        assert np.allclose(at, first, atol=1e-6, equal_nan=True)
        again = barymap.Map(source, target, made.anchors, landmarks=60, method="rbf", backend="cpu")
        assert np.allclose(again.vertex_positions(), first, atol=1e-6, equal_nan=True)


@pytest.mark.parametrize("kind", [np.uint8, np.uint16, np.float32, np.float64, np.float16, np.int64, np.int16, bool])
def test_types_of_pictures_are_kept(small, checker, kind):
    picture = checker[:, :, 2] > 0 if kind is bool else checker.astype(kind) / (1 if np.issubdtype(kind, np.integer) else 255)
    picture = picture.astype(kind)
    result = small.transfer(picture, size=64, margin=0).image
    assert result.dtype == picture.dtype and result.shape[:2] == (64, 64)
    assert result.shape[2:] == (() if kind is bool else (4,)) or kind is bool
    if kind is not bool:
        inside = result[20:44, 20:44, :3].astype(float)
        assert picture.min() <= inside.min() and inside.max() <= picture.max() and inside.std() > 0


def test_a_picture_is_carried_to_its_place(small):
    # u of the spheres is the longitude, so that a ramp along it stays one.
    ramp = np.tile(np.linspace(0, 1, 256, dtype=np.float32), (128, 1))[:, :, None].repeat(3, axis=2)
    made = small.transfer(ramp, size=(256, 128), margin=0, background=0)
    assert made.image.shape == (128, 256, 3) and set(made) == {"base_color"}
    expected = np.tile((np.arange(256) + 0.5) / 256, (128, 1))
    valid = (made.coverage == 255) & (abs(expected - 0.5) < 0.4)
    off = abs(made.image[:, :, 0] - expected)[valid]
    assert valid.mean() > 0.5 and np.median(off) < 0.01
    assert np.median(abs(1 - made.image[:, :, 0] - expected)[valid]) > 0.1, "the comparison sees a wrong picture"


def test_several_roles_go_at_once(small, checker):
    labels = (checker[:, :, :1] // 64 * 64).astype(np.uint8)
    normals = np.full((8, 8, 3), (128, 128, 255), np.uint8)
    made = small.transfer({"base_color": checker, "mask": (labels, "labels"), "normal": normals}, size=64, stmap=True)
    assert list(made) == ["base_color", "mask", "normal"]
    only = made["mask"][..., 0] if made["mask"].ndim == 3 else made["mask"]
    assert set(np.unique(only)) <= set(np.unique(labels)) | {0}
    assert made.stmap.shape == (64, 64, 4) and made.stmap.dtype == np.float32
    assert made.coverage.shape == (64, 64) and made.coverage.dtype == np.uint8
    flat = made["normal"][made.coverage == 255][:, :3].astype(int)
    assert (abs(flat - (128, 128, 255)) < 24).mean() > 0.95, "flat normals stay flat"


def test_data_of_vertices(spheres, small):
    source, target, _ = spheres
    values, status = small.transfer_attributes(source.vertices)
    assert values.shape == target.vertices.shape
    assert np.median(np.linalg.norm(values * 2 - target.vertices, axis=1)) < 0.15
    assert set(status) <= {1, 2, 3}
    weights = np.random.default_rng(1).random((len(source.vertices), 4))
    carried = small.transfer_attributes(weights, kind="weights", top=2).values
    assert np.allclose(carried.sum(axis=1), 1) and ((carried > 0).sum(axis=1) <= 2).all()
    labels = (source.vertices[:, 2] > 0).astype(int)
    carried = small.transfer_attributes(labels, kind="labels").values
    assert carried.shape == (len(target.vertices),) and set(carried) <= {0, 1}


def test_the_command_line_makes_the_same_bytes(demo, program, tmp_path):
    source, target, pairs = demo / "source.obj", demo / "target.obj", demo / "pairs.json"
    texture = demo / "source_texture.png"
    options = ["--landmarks", 200, "--backend", "cpu"]
    program(
        "transfer", "--source", source, "--target", target, "--anchors", pairs, "--texture", texture, "--size", 256,
        "-o", tmp_path / "cli.png", "--coverage", tmp_path / "cover.png", "--report", tmp_path / "r.json", *options,
    )
    made = barymap.Map(source, target, pairs, landmarks=200, backend="cpu")
    result = made.transfer(barymap.read_image(texture), size=256)
    barymap.write_image(tmp_path / "python.png", result.image)
    barymap.write_image(tmp_path / "python_cover.png", result.coverage)
    assert (tmp_path / "python.png").read_bytes() == (tmp_path / "cli.png").read_bytes()
    assert (tmp_path / "python_cover.png").read_bytes() == (tmp_path / "cover.png").read_bytes()
    report = json.loads((tmp_path / "r.json").read_text())
    for key in ("covered", "valid", "valid_fraction", "padded"):
        assert result.report[key] == report[key], key
    for key in ("flipped_area", "stretch_all", "field"):
        assert made.report[key] == report[key], key
    other = barymap.Map(source, target, pairs, landmarks=210, backend="cpu").transfer(
        barymap.read_image(texture), size=256
    )
    assert not np.array_equal(other.image, result.image), "the comparison sees another map"
    # The same meshes as arrays.
    arrays = [barymap.Mesh(m.vertices, m.faces, m.uv) for m in (made.source, made.target)]
    same = barymap.Map(*arrays, pairs, landmarks=200, backend="cpu").transfer(barymap.read_image(texture), size=256)
    assert np.array_equal(same.image, result.image)
    # The map of the vertices.
    program("map", "--source", source, "--target", target, "--anchors", pairs, "-o", tmp_path / "map.csv", *options)
    with open(tmp_path / "map.csv", newline="") as file:
        rows = list(csv.DictReader(file))
    images = made.vertices()
    words = np.array(["failed", "doubtful", "valid"])[images.status]
    assert [row["status"] for row in rows] == words.tolist()
    faces = [int(row["face"]) if row["face"] else -1 for row in rows]
    assert faces == images.faces.tolist()


def test_the_command_line_carries_the_same_attributes(demo, program, tmp_path):
    source, target, pairs = demo / "source.obj", demo / "target.obj", demo / "pairs.json"
    made = barymap.Map(source, target, pairs, landmarks=200, backend="cpu")
    values = made.source.vertices
    np.save(tmp_path / "in.npy", values)
    program(
        "attributes", "--source", source, "--target", target, "--anchors", pairs, "--attributes", tmp_path / "in.npy",
        "-o", tmp_path / "out.npy", "--landmarks", 200, "--backend", "cpu",
    )
    assert np.array_equal(np.load(tmp_path / "out.npy"), made.transfer_attributes(values).values, equal_nan=True)


ROOT = pathlib.Path(__file__).resolve().parents[3]


def blocks(page):
    """The blocks of Python of a page."""
    return re.findall(r"```python\n(.*?)```", (ROOT / page).read_text(), re.S)


@pytest.mark.parametrize("page", ["README.md", "docs/python.md"])
def test_blocks_of_the_documentation_run(demo, monkeypatch, page):
    """As they stand, one after the other, after `barymap demo`."""
    found = blocks(page)
    assert len(found[0].strip().splitlines()) == 4
    monkeypatch.chdir(demo.parent)
    (demo.parent / "out").symlink_to(demo)
    try:
        names = {}
        for block in found:
            exec(compile(block, page, "exec"), names)
        assert barymap.read_image("new.png").shape == (1024, 1024, 4)
    finally:
        (demo.parent / "out").unlink()
