"""Mean-value encodings: poses, sequences, blends."""

from __future__ import annotations

import json
from typing import Any, Dict, List, NamedTuple, Optional, Sequence, Union

import numpy as np
import numpy.typing as npt

from . import _barymap
from . import _inputs as take
from ._mesh import mesh_of, vertices_of
from .errors import InputError, OptionError


class Pose(NamedTuple):
    """A posed mesh.

    vertices : (n, 3) float64
    report : measures of the change: ``edge_rms``, ``volume_ratio``, ``flipped`` ...
    """

    vertices: npt.NDArray[np.float64]
    report: Dict[str, Any]


class Played(NamedTuple):
    """Frames.

    vertices : (t, n, 3) float64
    found_anew : frames to which the one before did not lead
    """

    vertices: npt.NDArray[np.float64]
    found_anew: List[int]


class Encoding:
    """A mesh whose shape is kept while some of its vertices move.

    Parameters
    ----------
    mesh : Mesh, path, or anything like a trimesh
    handles : (k,) vertices whose places will be given; without them there are only blends
    region : vertices that may move; all without

    >>> import barymap
    >>> corners = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]
    >>> mesh = barymap.Mesh(corners, [[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]])
    >>> encoding = barymap.Encoding(mesh, [0, 1, 2], cache=False, backend="cpu")
    >>> encoding.deform(mesh.vertices[:3] + [1, 2, 3]).vertices.round(9)[3].tolist()
    [1.0, 2.0, 4.0]
    >>> barymap.Encoding(mesh).morph([2 * mesh.vertices], frames=3).shape
    (3, 4, 3)
    """

    def __init__(
        self,
        mesh: Any,
        handles: Optional[npt.ArrayLike] = None,
        *,
        region: Optional[npt.ArrayLike] = None,
        backend: str = "auto",
        adapter: Optional[str] = None,
        memory: Union[int, str] = "4G",
        cache: bool = True,
        progress: Any = None,
    ) -> None:
        self._mesh = mesh_of(mesh, "mesh")
        self._common = take.common(backend, adapter, memory, cache)
        self._poser: Optional[_barymap.Poser] = None
        if handles is not None:
            ids = list(vertices_of(handles, self._mesh, "handles"))
            if not ids:
                raise InputError("there are none", "handles", "Give one vertex at least")
            part = None if region is None else list(vertices_of(region, self._mesh, "region"))
            self._poser = _barymap.Poser(self._mesh._shape, ids, part, self._common, take.progress(progress))
            self._count = len(ids)

    def _posed(self) -> _barymap.Poser:
        if self._poser is None:
            raise InputError("there are none", "handles", "Give them to barymap.Encoding")
        return self._poser

    @property
    def notes(self) -> List[str]:
        """What is odd but no error."""
        return self._posed().notes

    def deform(
        self,
        positions: npt.ArrayLike,
        *,
        quality: str = "default",
        stiffness: float = 0.0,
        sweeps: int = 0,
        warm: bool = False,
        progress: Any = None,
    ) -> Pose:
        """The mesh with its handles at ``positions`` (k, 3).

        quality : {"splits", "preview", "default", "converged"}
        stiffness : how strongly edges keep their lengths: 0 not at all, 1 well
        warm : begin from the pose before
        """
        poser = self._posed()
        made, report = poser.deform(
            take.floats(positions, "positions", (self._count, 3)),
            take.word(quality, "quality"),
            take.number(stiffness, "stiffness"),
            take.whole(sweeps, "sweeps", 0, 1000),
            bool(warm),
            take.progress(progress),
        )
        return Pose(made, json.loads(report))

    def animate(
        self,
        frames: npt.ArrayLike,
        *,
        quality: str = "default",
        stiffness: float = 0.0,
        progress: Any = None,
    ) -> Played:
        """The mesh for a sequence ``frames`` (t, k, 3) of its handles' places: smooth in time, and
        much faster than as many poses. ``quality`` is ``preview`` or ``default``."""
        poser = self._posed()
        made, anew = poser.animate(
            take.floats(frames, "frames", (None, self._count, 3)),
            take.word(quality, "quality"),
            take.number(stiffness, "stiffness"),
            take.progress(progress),
        )
        return Played(made, anew)

    def morph(
        self,
        shapes: Sequence[npt.ArrayLike],
        *,
        frames: int = 11,
        weights: Optional[npt.ArrayLike] = None,
        anchors: Optional[npt.ArrayLike] = None,
        quality: str = "default",
        progress: Any = None,
    ) -> npt.NDArray[np.float64]:
        """In-betweens (t, n, 3) of this mesh and other ``shapes`` of it, each (n, 3).

        frames : how many, at equal distances from the mesh through all shapes
        weights : (t, 1 + shapes) instead, each row with the sum 1, the mesh's own first
        anchors : vertices that carry the place and turn of an in-between; chosen without
        quality : {"preview", "default", "converged"}
        """
        count = self._mesh._shape.counts[0]
        if isinstance(shapes, np.ndarray) and shapes.ndim == 2:
            shapes = [shapes]
        others = [
            take.floats(getattr(shape, "vertices", shape), f"shapes, {k}", (count, 3)) for k, shape in enumerate(shapes)
        ]
        if not others:
            raise InputError("there are none", "shapes", "Give one at least")
        if weights is None:
            rows = _through(len(others) + 1, take.whole(frames, "frames", 1, 10_000))
        else:
            rows = take.floats(weights, "weights", (None, len(others) + 1)).tolist()
            if not rows:
                raise OptionError("there are none", "weights", "Give a row for each in-between")
        held = None if anchors is None else list(vertices_of(anchors, self._mesh, "anchors"))
        name = take.word(quality, "quality")
        made: npt.NDArray[np.float64] = _barymap.morph(
            self._mesh._shape, others, rows, held, name, self._common, take.progress(progress)
        )
        return made


def _through(shapes: int, count: int) -> List[List[float]]:
    """Weights of ``count`` frames through all shapes at equal distances."""
    last = float(shapes - 1)
    times = [0.0 if count == 1 else last * k / (count - 1) for k in range(count)]
    return [[max(0.0, 1.0 - abs(t - m)) for m in range(shapes)] for t in times]
