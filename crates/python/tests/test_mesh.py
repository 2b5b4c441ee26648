"""Meshes from arrays, objects and files."""

import numpy as np
import pytest
from conftest import sphere

import barymap


def test_types_orders_and_contiguity_do_not_matter():
    vertices, faces, uv = sphere(8, 4)
    plain = barymap.Mesh(vertices, faces, uv)
    for v, f in [
        (np.asfortranarray(vertices), faces.astype(np.int64)),
        (vertices.tolist(), faces.tolist()),
        (np.repeat(vertices, 2, axis=0)[::2], faces.astype(np.uint8)),
        (vertices, faces.astype(float)),
        (vertices.astype(object), np.asfortranarray(faces.astype(np.uint64))),
    ]:
        mesh = barymap.Mesh(v, f, uv)
        assert np.array_equal(mesh.vertices, plain.vertices) and np.array_equal(mesh.faces, plain.faces)
    single = barymap.Mesh(vertices.astype(np.float32), faces)
    assert np.array_equal(single.vertices, vertices.astype(np.float32))
    assert plain.vertices.dtype == np.float64 and plain.faces.dtype == np.int32
    assert np.array_equal(plain.faces, faces) and np.array_equal(plain.uv, uv)


def test_forms_of_texture_coordinates_say_the_same():
    vertices, faces, _ = sphere(8, 4)
    per_vertex = vertices[:, :2] * 0.5 + 0.5
    corners = per_vertex[faces]
    for uv in (per_vertex, corners, (per_vertex, faces)):
        assert np.array_equal(barymap.Mesh(vertices, faces, uv).uv, corners)
    assert barymap.Mesh(vertices, faces).uv is None


def test_the_array_is_copied():
    vertices, faces, _ = sphere(8, 4)
    mesh = barymap.Mesh(vertices, faces)
    vertices[0] = 9
    mesh.vertices[1] = 9
    assert abs(mesh.vertices).max() == 1


@pytest.mark.parametrize("extension", ["obj", "ply", "glb"])
def test_files_come_back(tmp_path, extension):
    vertices, faces, uv = sphere(8, 4)
    mesh = barymap.Mesh(vertices, faces, uv)
    mesh.write(tmp_path / f"m.{extension}")
    back = barymap.read(tmp_path / f"m.{extension}")
    assert len(back.faces) == len(faces)
    corners = lambda m: m.vertices[m.faces]
    assert np.allclose(corners(back), corners(mesh), atol=1e-6)
    assert extension == "ply" or np.allclose(back.uv, uv, atol=1e-6)


def test_repeated_vertices_are_joined_unless_told():
    vertices, faces, _ = sphere(8, 4)
    apart = vertices[faces].reshape(-1, 3), np.arange(faces.size).reshape(-1, 3)
    joined = barymap.Mesh(*apart)
    assert len(joined.vertices) == faces.size, "vertices keep their numbers"
    whole, pairs = barymap.Mesh(vertices, faces), [[0, 0], [1, 1]]
    assert barymap.Map(joined, joined, [[0, 0]]).report["valid_fraction"] == 1
    loose = barymap.Mesh(*apart, weld=None)
    assert any("components" in note or "parts" in note for note in loose.notes) or loose.notes != joined.notes
    assert whole.area == pytest.approx(joined.area) and pairs


def test_other_libraries_meshes_are_taken():
    trimesh, meshio = pytest.importorskip("trimesh"), pytest.importorskip("meshio")
    vertices, faces, uv = sphere(8, 4)
    mesh = barymap.Mesh(vertices, faces, uv)
    other = mesh.to_trimesh()
    assert isinstance(other, trimesh.Trimesh)
    back = barymap.Mesh.from_trimesh(other)
    assert np.array_equal(back.vertices[back.faces], vertices[faces]) and np.array_equal(back.uv, uv)
    plain = barymap.Mesh.from_trimesh(trimesh.Trimesh(vertices, faces, process=False))
    assert np.array_equal(plain.faces, faces) and plain.uv is None
    flat = barymap.Mesh.from_meshio(
        meshio.Mesh([[0, 0], [1, 0], [1, 1], [0, 1], [2, 0]], [("quad", [[0, 1, 2, 3]]), ("triangle", [[1, 4, 2]])])
    )
    assert flat.faces.tolist() == [[0, 1, 2], [0, 2, 3], [1, 4, 2]]


def test_vertices_move():
    mesh = barymap.Mesh(*sphere(8, 4))
    moved = mesh.with_vertices(mesh.vertices * 2)
    assert moved.area == pytest.approx(4 * mesh.area) and np.array_equal(moved.uv, mesh.uv)
