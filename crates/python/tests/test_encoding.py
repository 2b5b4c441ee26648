"""Poses, sequences, blends."""

import json

import numpy as np
import pytest
from conftest import sphere

import barymap


@pytest.fixture(scope="module")
def ball():
    vertices, faces, _ = sphere(16, 10)
    return barymap.Mesh(vertices, faces)


HANDLES = [0, 1, 2 + 4 * 16, 2 + 4 * 16 + 4, 2 + 4 * 16 + 8, 2 + 4 * 16 + 12]


def test_handles_that_turn_turn_the_mesh(ball):
    encoding = barymap.Encoding(ball, HANDLES, cache=False, backend="cpu")
    turn = np.array([[0, -1, 0], [1, 0, 0], [0, 0, 1.0]])
    moved = 1.5 * ball.vertices @ turn.T + (1, 2, 3)
    posed = encoding.deform(moved[HANDLES])
    assert abs(posed.vertices - moved).max() < 1e-6, "a similarity is reproduced"
    assert posed.report["flipped"] == 0
    up = ball.vertices[HANDLES].copy()
    up[0, 2] += 0.4
    posed = encoding.deform(up)
    assert np.array_equal(posed.vertices[HANDLES], up), "handles are where they were put"
    assert 0 < posed.report["edge_rms"] < 1


def test_a_sequence_stands_where_its_handles_stand(ball):
    encoding = barymap.Encoding(ball, HANDLES, cache=False, backend="cpu")
    rest = ball.vertices[HANDLES]
    frames = np.stack([rest + (0, 0, 0), rest + (0.5, 0, 0), rest + (0.5, 0, 0)])
    played = encoding.animate(frames)
    assert played.vertices.shape == (3, len(ball.vertices), 3)
    assert np.array_equal(played.vertices[1], played.vertices[2])
    assert abs(played.vertices[1] - ball.vertices - (0.5, 0, 0)).max() < 1e-6
    assert np.array_equal(played.vertices[:, HANDLES], frames)


def test_blends_begin_and_end_at_their_shapes(ball):
    other = ball.vertices * (1, 1, 1.8)
    blends = barymap.Encoding(ball).morph([other], frames=3)
    assert blends.shape == (3, len(other), 3)
    assert abs(blends[0] - ball.vertices).max() < 1e-9 and abs(blends[2] - other).max() < 1e-9
    height = np.ptp(blends[1][:, 2])
    assert 2.2 < height < 3.4
    one = barymap.Encoding(ball).morph([other], weights=[[0.5, 0.5]])
    assert one.shape == (1, len(other), 3)


def test_the_command_line_makes_the_same_bytes(demo, program, tmp_path):
    mesh = barymap.read(demo / "source.obj")
    handles = [0, 100, 2000, 3000, 4000, 5000]
    positions = mesh.vertices[handles] + np.array([[0, 0.1, 0]] + [[0, 0, 0]] * 5)
    text = {"handles": [{"vertex": v, "position": p} for v, p in zip(handles, positions.tolist())]}
    (tmp_path / "h.json").write_text(json.dumps(text))
    program("deform", demo / "source.obj", "--handles", tmp_path / "h.json", "-o", tmp_path / "cli.obj", "--backend", "cpu")
    posed = barymap.Encoding(mesh, handles, backend="cpu").deform(positions)
    written = barymap.read(tmp_path / "cli.obj").vertices
    assert np.array_equal(written, posed.vertices)
    assert not np.array_equal(written, mesh.vertices)
    other = mesh.vertices * (1, 1.1, 1)
    mesh.with_vertices(other).write(tmp_path / "other.obj")
    program("morph", demo / "source.obj", tmp_path / "other.obj", "--weights", "0.5,0.5", "-o", tmp_path / "half.obj")
    half = barymap.Encoding(mesh).morph([barymap.read(tmp_path / "other.obj").vertices], weights=[[0.5, 0.5]])
    assert np.array_equal(barymap.read(tmp_path / "half.obj").vertices, half[0])


def test_meshes_of_different_connectivity_become_alike(small, spheres):
    _, target, _ = spheres
    positions, report = small.compatible()
    assert positions.shape == target.vertices.shape and report["bad"] == 0
    assert abs(np.linalg.norm(positions, axis=1) - 1).max() < 0.1, "the unit sphere with the target's vertices"
    blends = barymap.Encoding(target).morph([positions], frames=3)
    assert blends.shape[0] == 3
