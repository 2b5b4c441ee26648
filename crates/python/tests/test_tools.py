"""Splines, decals, charts, pairs."""

import json

import numpy as np
import pytest
from conftest import NET_SOURCE, PAIRS, sphere

import barymap


def test_a_spline_runs_on_the_surface(spheres):
    source, _, _ = spheres
    ring = [2 + 5 * 24 + 4 * k for k in range(6)]
    curve = barymap.spline(source, ring, closed=True, landmarks=100)
    assert curve.vertices.shape == (len(curve.points), 3) == curve.points.barycentric.shape
    on = np.einsum("nk,nkj->nj", curve.points.barycentric, source.vertices[source.faces[curve.points.faces]])
    assert abs(on - curve.vertices).max() < 1e-9
    assert 5.0 < curve.report["length"] < 2 * np.pi and curve.runs.tolist() == [0]
    # By position it is the same curve.
    again = barymap.spline(source, source.vertices[ring], closed=True, landmarks=100)
    assert abs(again.report["length"] - curve.report["length"]) < 1e-3


def test_a_decal_shows_its_picture(spheres, checker):
    source, _, _ = spheres
    ring = lambda r, k: 2 + (r - 1) * 24 + k
    corners = [ring(8, 2), ring(8, 8), ring(4, 8), ring(4, 2)]
    made = barymap.decal(source, checker, corners, size=256)
    assert made.image.shape == (256, 256, 4) and made.image.dtype == np.uint8
    assert made.report["shown"] > 0.9 and not made.report["mirrored"]
    shown = made.image[:, :, 3] == 255
    # Longitudes 2/24 to 8/24, latitudes 4/12 to 8/12 of the texture.
    assert 0.5 < shown.sum() / (256 * 256 * 6 / 24 * 4 / 12) < 1.5
    base = np.full((128, 128, 3), 200, np.uint8)
    drawn = barymap.decal(source, checker, corners, texture=base).image
    assert drawn.shape == base.shape and (drawn != base).any() and (drawn == base).any()


def test_charts_are_made(demo, program, tmp_path):
    vertices, faces, _ = sphere(24, 12)
    mesh = barymap.unwrap(barymap.Mesh(vertices, faces), size=512)
    assert mesh.uv.shape == (len(faces), 3, 2) and np.nanmin(mesh.uv) >= 0 and np.nanmax(mesh.uv) <= 1
    assert mesh.report["overlapping_faces"] == [] and np.array_equal(mesh.faces, faces)
    program("unwrap", demo / "target.obj", "-o", tmp_path / "cli.obj")
    barymap.unwrap(demo / "target.obj").write(tmp_path / "python.obj")
    assert (tmp_path / "cli.obj").read_bytes() == (tmp_path / "python.obj").read_bytes()


def test_pairs_are_proposed_and_doubted(demo, program, tmp_path):
    source, target, pairs = demo / "source.obj", demo / "target.obj", demo / "pairs.json"
    known = json.loads(pairs.read_text())
    seeds = {side: known[side][:12] for side in ("source", "target")}
    found = barymap.anchors(source, target, seeds, count=30, suggest=2, landmarks=200)
    assert len(found.source) == len(found.target) <= 30 and len(found.source) > 12
    assert len(found.report["suggestions"]) == 2
    (tmp_path / "seeds.json").write_text(json.dumps(seeds))
    program(
        "anchors", source, target, "--anchors", tmp_path / "seeds.json", "--count", 30, "-o", tmp_path / "cli.json",
        "--landmarks", 200, "--report", tmp_path / "r.json", "--suggest", 2,
    )
    report = json.loads((tmp_path / "r.json").read_text())
    assert report["pairs"] == found.report["pairs"] and report["suggestions"] == found.report["suggestions"]
    exchanged = {**seeds, "target": [*seeds["target"][1::-1], *seeds["target"][2:]]}
    doubted = barymap.anchors(source, target, exchanged, check=True, landmarks=200)
    assert {o["pair"] for o in doubted.report["outliers"]} <= {0, 1}


def test_pictures_of_files_come_back(tmp_path, checker):
    for picture in (checker, checker[:, :, 0], checker.astype(np.uint16) * 200):
        barymap.write_image(tmp_path / "p.png", picture)
        back = barymap.read_image(tmp_path / "p.png")
        assert back.dtype == picture.dtype and np.array_equal(back, picture)


def test_proposed_pairs_make_a_map(spheres):
    source, target, pairs = spheres
    found = barymap.anchors(source, target, pairs, count=len(PAIRS), landmarks=60)
    made = barymap.Map(source, target, found, landmarks=60, backend="cpu")
    assert len(made.anchors[0]) == len(NET_SOURCE)
