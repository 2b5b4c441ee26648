"""Warps: pictures, points, proofs."""

import json

import numpy as np
import pytest

import barymap

SOURCE = [[0, 0], [48, 0], [96, 0], [96, 64], [48, 64], [0, 64]]
TARGET = [[0, 0], [48, 16], [96, 0], [96, 64], [48, 48], [0, 64]]


def test_the_identity_keeps_a_picture(checker):
    for picture in (checker, checker[:, :, 0], checker.astype(np.uint16) * 257, checker / 255.0):
        made = barymap.warp(picture, SOURCE, SOURCE, backend="cpu")
        assert made.image.shape == picture.shape and made.image.dtype == picture.dtype
        # Half precision of what the filter weighs.
        assert abs(made.image.astype(float) - picture).max() <= 0.02 * picture.max()


def test_a_proof_and_points_there_and_back():
    cage = barymap.Cage(SOURCE, TARGET, certify=True, backend="cpu")
    assert cage.report["bijective"] == "certified"
    assert all(step["lower_bound"] > 0 for step in cage.report["steps"])
    points = np.random.default_rng(3).random((500, 2)) * (96, 64)
    there = cage.points(points)
    assert there.found.all() and (there.jacobian > 0).all()
    back = cage.points(there.points, inverse=True)
    assert abs(back.points - points).max() < 1e-9
    assert abs(cage.points(SOURCE).points - TARGET).max() < 1e-9
    assert barymap.certify(SOURCE, TARGET)["bijective"] == "certified"
    half = barymap.Cage(SOURCE, TARGET).warp(np.zeros((64, 96, 3)), time=0.5)
    assert half.report["failed"]["inside"] == 0


def test_a_fold_is_told():
    far = [[0, 0], [48, 60], [96, 0], [96, 64], [48, 4], [0, 64]]
    with pytest.raises(barymap.BarymapError):
        barymap.Cage(SOURCE, far, partition="direct", strict=True)


def test_the_command_line_makes_the_same_bytes(program, checker, tmp_path):
    barymap.write_image(tmp_path / "in.png", checker)
    cage = {"units": "pixel", "source": SOURCE, "target": TARGET}
    (tmp_path / "cage.json").write_text(json.dumps(cage))
    options = ["--cage", tmp_path / "cage.json", "--backend", "cpu", "--report", tmp_path / "r.json"]
    program("warp", tmp_path / "in.png", "-o", tmp_path / "cli.png", "--certify", *options)
    made = barymap.warp(checker, SOURCE, TARGET, certify=True, backend="cpu")
    barymap.write_image(tmp_path / "python.png", made.image)
    assert (tmp_path / "python.png").read_bytes() == (tmp_path / "cli.png").read_bytes()
    report = json.loads((tmp_path / "r.json").read_text())
    for key in ("bijective", "partition", "steps", "mapped"):
        assert made.report[key] == report[key], key
    other = barymap.warp(checker, SOURCE, [[p[0], p[1] * 0.99] for p in TARGET], backend="cpu")
    assert not np.array_equal(other.image, made.image), "the comparison sees another cage"
    (tmp_path / "p.csv").write_text("x,y\n10,10\n50,40\n")
    program("warp-points", tmp_path / "p.csv", "-o", tmp_path / "q.csv", *options)
    points = barymap.warp_points([[10, 10], [50, 40]], SOURCE, TARGET, backend="cpu").points
    rows = [line.split(",") for line in (tmp_path / "q.csv").read_text().split()]
    at = [rows[0].index("x"), rows[0].index("y")]
    written = np.array([[float(row[i]) for i in at] for row in rows[1:]])
    assert np.array_equal(written, points) or abs(written - points).max() < 1e-12 * 96
