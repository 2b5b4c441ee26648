"""Anchors: corresponding points of two meshes, in any of the forms that people have."""

from __future__ import annotations

import os
from typing import Any, Optional, Tuple, Union

import numpy as np
import numpy.typing as npt

from . import _inputs as take
from .errors import InputError

#: How far written coordinates may lie off the triangle or off the sum 1, for rounding.
_SLACK = 1e-6


def _side(kinds: Any, ids: Any, values: Any) -> dict[str, Any]:
    return {"kinds": list(kinds), "ids": list(ids), "values": [tuple(v) for v in values]}


def _vertices(ids: "npt.NDArray[np.uint32]") -> dict[str, Any]:
    return _side([0] * len(ids), ids.tolist(), [(0.0, 0.0, 0.0)] * len(ids))


def _positions(points: "npt.NDArray[np.float64]") -> dict[str, Any]:
    return _side([2] * len(points), [0] * len(points), points.tolist())


def _faces(faces: Any, barycentric: Any, name: str) -> dict[str, Any]:
    faces = take.indices(faces, f"{name}, faces", (None,))
    barycentric = take.floats(barycentric, f"{name}, barycentric", (len(faces), 3))
    sums = barycentric.sum(axis=1) if len(faces) else np.ones(0)
    bad = np.flatnonzero((np.abs(sums - 1.0) > _SLACK) | (barycentric < -_SLACK).any(axis=1))
    if bad.size:
        k = int(bad[0])
        remedy = "Barycentric coordinates are nonnegative and sum to one"
        raise InputError(f"the coordinates of anchor {k} are {barycentric[k].tolist()}", name, remedy)
    clamped = np.maximum(barycentric, 0.0)
    scaled = clamped / (clamped[:, :1] + clamped[:, 1:2] + clamped[:, 2:3])
    return _side([1] * len(faces), faces.tolist(), scaled.tolist())


def _entries(entries: Any, name: str) -> dict[str, Any]:
    """A list as in a JSON file: vertices, {"face", "barycentric"}, {"position"}."""
    kinds, ids, values = [], [], []
    for k, entry in enumerate(entries):
        where = f"{name}, anchor {k}"
        if isinstance(entry, dict):
            if "face" in entry and "barycentric" in entry:
                one = _faces([entry["face"]], [entry["barycentric"]], where)
            elif "position" in entry:
                one = _positions(take.floats([entry["position"]], where, (1, 3)))
            elif "vertex" in entry:
                one = _vertices(take.indices([entry["vertex"]], where, (1,)))
            else:
                remedy = "Give a vertex, {face, barycentric} or {position}"
                raise InputError(f"{entry!r} has no known form", where, remedy)
        else:
            one = _vertices(take.indices([entry], where, (1,)))
        kinds += one["kinds"]
        ids += one["ids"]
        values += one["values"]
    return _side(kinds, ids, values)


def side(value: Any, name: str) -> dict[str, Any]:
    """Points of one mesh: vertices (k,), positions (k, 3), (faces, barycentric), or a list as in a
    JSON file."""
    if isinstance(value, Points):
        return _faces(value.faces, value.barycentric, name)
    if isinstance(value, dict):
        raise InputError("it is a dictionary", name, "Give a list of points")
    if isinstance(value, tuple) and len(value) == 2 and np.ndim(value[0]) == 1 and np.ndim(value[1]) == 2:
        return _faces(value[0], value[1], name)
    if isinstance(value, (list, tuple)) and any(isinstance(entry, dict) for entry in value):
        return _entries(value, name)
    array = np.asarray(value) if not isinstance(value, np.ndarray) else value
    if array.ndim == 2:
        return _positions(take.floats(value, name, (None, 3)))
    return _vertices(take.indices(value, name, (None,)))


class Points:
    """Points of a surface.

    faces : (k,) int32, triangles of the mesh, from 0
    barycentric : (k, 3) float64, coordinates with respect to their corners, which sum to one
    """

    faces: "npt.NDArray[np.int32]"
    barycentric: "npt.NDArray[np.float64]"

    def __init__(self, faces: Any, barycentric: Any) -> None:
        self.faces = np.asarray(faces, dtype=np.int32)
        self.barycentric = np.asarray(barycentric, dtype=np.float64)

    def __len__(self) -> int:
        return len(self.faces)

    def __repr__(self) -> str:
        return f"Points({len(self)})"


Given = Union[str, Tuple[dict[str, Any], dict[str, Any]]]


def pairs(value: Any) -> Given:
    """Pairs: vertices (k, 2); (source, target), each as :func:`side` takes it; a dictionary as in a
    JSON file; or the name of a file."""
    if isinstance(value, (str, bytes, os.PathLike)):
        return take.path(value, "anchors")
    if hasattr(value, "source") and hasattr(value, "target"):
        value = (value.source, value.target)
    if isinstance(value, dict):
        if "source" not in value or "target" not in value:
            raise InputError("it has no lists source and target", "anchors", 'Give {"source": [...], "target": [...]}')
        both = (_entries(value["source"], "anchors, source"), _entries(value["target"], "anchors, target"))
    elif isinstance(value, tuple) and len(value) == 2:
        both = (side(value[0], "anchors, source"), side(value[1], "anchors, target"))
    else:
        ids = take.indices(value, "anchors", (None, 2))
        both = (_vertices(ids[:, 0]), _vertices(ids[:, 1]))
    counts = [len(s["ids"]) for s in both]
    if counts[0] != counts[1]:
        remedy = "Give as many of one as of the other, in the same order"
        raise InputError(f"{counts[0]} on the source and {counts[1]} on the target", "anchors", remedy)
    return both


def optional(value: Any) -> Optional[Given]:
    """As :func:`pairs`, or nothing."""
    return None if value is None else pairs(value)
