"""Warps of the plane by cages."""

from __future__ import annotations

import json
from typing import Any, Dict, List, NamedTuple, Optional, Union

import numpy as np
import numpy.typing as npt

from . import _barymap
from . import _inputs as take
from .errors import InputError


def _loops(value: Any, name: str) -> List[npt.NDArray[np.float64]]:
    """A polygon (k, 2), or a list of nested loops."""
    if isinstance(value, (list, tuple)) and value and all(np.ndim(part) == 2 for part in value):
        return [take.floats(part, f"{name}, loop {k}", (None, 2)) for k, part in enumerate(value)]
    return [take.floats(value, name, (None, 2))]


class Warped(NamedTuple):
    """A warped picture.

    image : (h, w) or (h, w, c), in the type that was given
    jacobian : (h, w) float32, of the map at the pre-image of every pixel, if asked for
    report : counts
    """

    image: npt.NDArray[Any]
    jacobian: Optional[npt.NDArray[np.float32]]
    report: Dict[str, Any]


class Moved(NamedTuple):
    """Points under a cage's map.

    points : (n, 2) float64, NaN where there is no image
    found : (n,) bool
    jacobian : (n,) float64
    """

    points: npt.NDArray[np.float64]
    found: npt.NDArray[np.bool_]
    jacobian: npt.NDArray[np.float64]


class Cage:
    """The map of a cage: a polygon on a picture, and where its vertices go.

    Parameters
    ----------
    source, target : (k, 2), or a list of nested loops
        The polygon before and after.
    path, partition, eps, resolution, coordinates, certify, boxes, strict
        As the command line's; ``certify=True`` proves that no step folds.

    ``report["bijective"]`` is ``certified``, ``sampled`` or ``failed``.

    >>> import barymap
    >>> square = [[0, 0], [8, 0], [8, 8], [0, 8]]
    >>> cage = barymap.Cage(square, [[0, 0], [8, 0], [6, 6], [0, 8]], certify=True)
    >>> cage.report["bijective"]
    'certified'
    >>> cage.points([[8, 8]]).points.round(6).tolist()
    [[6.0, 6.0]]
    """

    def __init__(
        self,
        source: Any,
        target: Any,
        *,
        path: str = "intrinsic",
        partition: str = "binary",
        eps: float = 0.01,
        resolution: int = 256,
        coordinates: str = "mean-value",
        certify: bool = False,
        boxes: int = 400_000,
        strict: bool = False,
        backend: str = "auto",
        adapter: Optional[str] = None,
        memory: Union[int, str] = "4G",
        progress: Any = None,
    ) -> None:
        mapping = {
            "path": take.word(path, "path"),
            "partition": take.word(partition, "partition"),
            "eps": take.number(eps, "eps"),
            "resolution": take.whole(resolution, "resolution", 1, 1 << 20),
            "coordinates": take.word(coordinates, "coordinates"),
            "certify": bool(certify),
            "boxes": take.whole(boxes, "boxes", 1, 1 << 40),
            "strict": bool(strict),
        }
        self._cage = _barymap.Cage(
            _loops(source, "source"),
            _loops(target, "target"),
            mapping,
            take.common(backend, adapter, memory, True),
            take.progress(progress),
        )

    @property
    def report(self) -> Dict[str, Any]:
        """What is known of the map: its steps, their smallest Jacobians, whether it is proved."""
        made: Dict[str, Any] = json.loads(self._cage.report())
        return made

    def warp(
        self,
        image: npt.ArrayLike,
        *,
        units: str = "pixel",
        filter: str = "ewa",
        outside: str = "map",
        size: Optional[take.Size] = None,
        linear_light: bool = False,
        jacobian: bool = False,
        time: float = 1.0,
        progress: Any = None,
    ) -> Warped:
        """Warps a picture (h, w) or (h, w, c).

        units : "pixel" (x right, y down, from the upper left corner) or "unit" (heights of the
            picture, y up, from the lower left one)
        size : width and height of the result; those of the picture without
        time : 0 to 1, how far of the way the cage has gone
        """
        array, back = take.picture(image, "image")
        share = take.number(time, "time")
        if not 0 <= share <= 1:
            raise InputError(f"it is {share}", "time", "Give a number from 0 to 1")
        look = {
            "units": take.word(units, "units"),
            "filter": take.word(filter, "filter"),
            "outside": take.word(outside, "outside"),
            "size": None if size is None else take.size(size),
            "linear_light": bool(linear_light),
            "jacobian": bool(jacobian),
            "time": share,
        }
        made, jacobians, report = self._cage.warp(array, look, take.progress(progress))
        return Warped(take.like(back(made)), jacobians, json.loads(report))

    def points(self, points: npt.ArrayLike, *, inverse: bool = False) -> Moved:
        """Images of points (n, 2), or with ``inverse`` their pre-images, in double precision."""
        return Moved(*self._cage.points(take.floats(points, "points", (None, 2)), bool(inverse)))


def warp(image: npt.ArrayLike, source: Any, target: Any, **options: Any) -> Warped:
    """Warps a picture by a cage: the arguments of :class:`Cage` and of :meth:`Cage.warp`. The
    report has both."""
    of_warp = ("units", "filter", "outside", "size", "linear_light", "jacobian", "time")
    look = {name: options.pop(name) for name in of_warp if name in options}
    cage = Cage(source, target, **options)
    made = cage.warp(image, progress=options.get("progress"), **look)
    return made._replace(report={**cage.report, **made.report})


def warp_points(
    points: npt.ArrayLike, source: Any, target: Any, *, inverse: bool = False, **options: Any
) -> Moved:
    """Images of points (n, 2) under a cage's map, or their pre-images: see :class:`Cage`."""
    return Cage(source, target, **options).points(points, inverse=inverse)


def certify(source: Any, target: Any, **options: Any) -> Dict[str, Any]:
    """Whether a cage's map is proved not to fold: the report of :class:`Cage`.

    >>> import barymap
    >>> square = [[0, 0], [1, 0], [1, 1], [0, 1]]
    >>> barymap.certify(square, square)["bijective"]
    'certified'
    """
    return Cage(source, target, certify=True, **options).report
