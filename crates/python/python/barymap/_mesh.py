"""Meshes."""

from __future__ import annotations

import importlib
from typing import Any, List, Optional, Tuple

import numpy as np
import numpy.typing as npt

from . import _barymap
from . import _inputs as take
from .errors import InputError, MeshError, OptionError


def _tolerance(weld: Any) -> float:
    if weld is None or weld is False or weld == "no":
        return -1.0
    value = take.number(weld, "weld")
    if value < 0:
        raise OptionError(f"it is {value}", "weld", "Give a distance, 0, or None to join nothing")
    return value


class Mesh:
    """A triangle mesh, with or without texture coordinates.

    Parameters
    ----------
    vertices : (n, 3) array
        Positions, in any unit.
    faces : (m, 3) array
        Vertices of the triangles, from 0, counter-clockwise seen from outside.
    uv : array, optional
        Texture coordinates, v = 1 at the top of the picture: one a vertex (n, 2), one a corner
        (m, 3, 2), or a pair of a list (k, 2) and the corners' indices in it (m, 3).
    weld : float or None, default 0
        Open edges that lie within this distance of one another are joined for the computation,
        which keeps vertex numbers; 0 joins those on one another, ``None`` none.
    name : str
        Used in messages.

    Arrays of any real type, order and contiguity are taken, and copied.

    >>> import barymap
    >>> mesh = barymap.Mesh([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]])
    >>> mesh
    Mesh('mesh', 4 vertices, 2 faces)
    >>> mesh.vertices.shape, mesh.faces.dtype, mesh.uv is None
    ((4, 3), dtype('int32'), True)
    """

    _shape: _barymap.Shape
    #: What was done to make it, where it comes from :func:`unwrap`.
    report: dict[str, Any]

    def __init__(
        self,
        vertices: npt.ArrayLike,
        faces: npt.ArrayLike,
        uv: Any = None,
        *,
        weld: Optional[float] = 0.0,
        name: str = "mesh",
    ) -> None:
        points = take.floats(vertices, "vertices", (None, 3), finite=False)
        triangles = take.indices(faces, "faces", (None, 3))
        if not np.isfinite(points).all():
            bad = int(np.flatnonzero(~np.isfinite(points).all(axis=1))[0])
            raise MeshError(f"the position of vertex {bad} is not finite", f"mesh {name}", "Correct it")
        flat = corners = uv_faces = None
        if isinstance(uv, tuple) and len(uv) == 2 and np.ndim(uv[0]) == 2 and np.ndim(uv[1]) == 2:
            flat = take.floats(uv[0], "uv", (None, 2))
            uv_faces = take.indices(uv[1], "uv, faces", (len(triangles), 3))
        elif uv is not None and np.ndim(uv) == 3:
            corners = take.floats(uv, "uv", (len(triangles), 3, 2))
        elif uv is not None:
            flat = take.floats(uv, "uv", (len(points), 2))
        tolerance = _tolerance(weld)
        made = _barymap.Shape.from_arrays(
            take.word(name, "name"), points, triangles, flat, corners, uv_faces, tolerance
        )
        self._set(made)

    def _set(self, shape: _barymap.Shape) -> None:
        self._shape = shape
        self.report = {}

    @classmethod
    def _of(cls, shape: _barymap.Shape) -> "Mesh":
        mesh = cls.__new__(cls)
        mesh._set(shape)
        return mesh

    @classmethod
    def from_trimesh(cls, mesh: Any, *, weld: Optional[float] = 0.0, name: str = "mesh") -> "Mesh":
        """From a ``trimesh.Trimesh``, or anything with ``vertices`` and ``faces``; texture
        coordinates are those of ``mesh.visual.uv``, if there are any.

        trimesh repeats vertices along texture seams. They are joined for the computation, as with
        files, and keep their numbers.
        """
        if not (hasattr(mesh, "vertices") and hasattr(mesh, "faces")):
            raise InputError("it has no vertices and faces", "mesh", "Give a trimesh.Trimesh")
        uv = getattr(getattr(mesh, "visual", None), "uv", None)
        return cls(mesh.vertices, mesh.faces, uv if uv is not None and len(uv) else None, weld=weld, name=name)

    @classmethod
    def from_meshio(cls, mesh: Any, *, weld: Optional[float] = 0.0, name: str = "mesh") -> "Mesh":
        """From a ``meshio.Mesh``, or anything with ``points`` and ``cells``: its triangles, and its
        quads cut from their first corner."""
        if not (hasattr(mesh, "points") and hasattr(mesh, "cells")):
            raise InputError("it has no points and cells", "mesh", "Give a meshio.Mesh")
        parts: List[npt.NDArray[Any]] = []
        for block in mesh.cells:
            kind, data = (block.type, block.data) if hasattr(block, "type") else block
            data = np.asarray(data)
            if kind == "triangle":
                parts.append(data)
            elif kind == "quad":
                parts.append(data[:, [0, 1, 2, 0, 2, 3]].reshape(-1, 3))
        if not parts:
            raise MeshError("it has no triangles and no quads", f"mesh {name}", "Give its surface")
        points = np.asarray(mesh.points)
        if points.ndim == 2 and points.shape[1] == 2:
            points = np.c_[points, np.zeros(len(points))]
        return cls(points, np.concatenate(parts), weld=weld, name=name)

    def to_trimesh(self) -> Any:
        """A ``trimesh.Trimesh`` of the same vertices and faces. One with texture coordinates has a
        vertex for each corner instead, as trimesh asks."""
        trimesh = importlib.import_module("trimesh")
        uv = self.uv
        if uv is None:
            return trimesh.Trimesh(self.vertices, self.faces, process=False)
        corners = self.faces.reshape(-1)
        visual = trimesh.visual.TextureVisuals(uv=uv.reshape(-1, 2))
        faces = np.arange(len(corners)).reshape(-1, 3)
        return trimesh.Trimesh(self.vertices[corners], faces, visual=visual, process=False)

    @property
    def name(self) -> str:
        """The name used in messages; of a file its path."""
        return self._shape.name

    @property
    def vertices(self) -> npt.NDArray[np.float64]:
        """Positions, (n, 3) float64."""
        return self._shape.vertices()

    @property
    def faces(self) -> npt.NDArray[np.int32]:
        """Vertices of the triangles, (m, 3) int32. Polygons of a file are cut into triangles,
        polygon by polygon."""
        return self._shape.faces()

    @property
    def uv(self) -> Optional[npt.NDArray[np.float64]]:
        """Texture coordinates of the corners, (m, 3, 2) float64, NaN where a corner has none;
        ``None`` if no triangle has any."""
        return self._shape.uv()

    @property
    def colors(self) -> Optional[npt.NDArray[np.float32]]:
        """Colours of the vertices, (n, 4) float32, 0 to 1, where a file has them."""
        return self._shape.colors()

    @property
    def materials(self) -> List[str]:
        """Names of the materials of a file."""
        return self._shape.materials

    @property
    def notes(self) -> List[str]:
        """What is odd about the mesh but no error, a sentence each."""
        return self._shape.notes

    @property
    def area(self) -> float:
        """Area of the surface, in squared units of the positions."""
        return self._shape.area

    def with_vertices(self, vertices: npt.ArrayLike) -> "Mesh":
        """The same mesh with its vertices elsewhere, (n, 3); its normals turn along."""
        count = self._shape.counts[0]
        return self._of(self._shape.moved(take.floats(vertices, "vertices", (count, 3))))

    def write(self, path: take.Path) -> None:
        """Writes OBJ, PLY or GLB, as the extension says: whole, or not at all."""
        self._shape.write(take.path(path, "path"))

    def __repr__(self) -> str:
        vertices, faces = self._shape.counts
        uv = ", uv" if self._shape.has_uv else ""
        return f"Mesh({self.name!r}, {vertices} vertices, {faces} faces{uv})"


def read(path: take.Path, *, weld: Optional[float] = 0.0, uv_set: Optional[int] = None) -> Mesh:
    """Reads a mesh: OBJ, PLY, OFF, glTF or GLB, as the command line does.

    ``uv_set`` names the set of texture coordinates of a glTF file; without it, it is the one that
    the material's base colour has.
    """
    chosen = None if uv_set is None else take.whole(uv_set, "uv_set", 0, 64)
    return Mesh._of(_barymap.Shape.open(take.path(path, "path"), _tolerance(weld), chosen))


def mesh_of(value: Any, name: str) -> Mesh:
    """A mesh: one of barymap, a file, or anything like a trimesh."""
    if isinstance(value, Mesh):
        return value
    if isinstance(value, (str, bytes)) or hasattr(value, "__fspath__"):
        return read(value)
    if hasattr(value, "vertices") and hasattr(value, "faces"):
        return Mesh.from_trimesh(value)
    if hasattr(value, "points") and hasattr(value, "cells"):
        return Mesh.from_meshio(value)
    if isinstance(value, tuple) and len(value) in (2, 3):
        return Mesh(*value)
    raise InputError(f"{type(value).__name__} is no mesh", name, "Give a barymap.Mesh, a file or (vertices, faces)")


def vertices_of(value: Any, mesh: Mesh, name: str) -> Tuple[int, ...]:
    """Vertices of a mesh."""
    ids = take.indices(value, name, (None,))
    count = mesh._shape.counts[0]
    if ids.size and int(ids.max()) >= count:
        raise InputError(f"vertex {int(ids.max())} of {count}", name, "Vertices count from 0")
    return tuple(ids.tolist())
