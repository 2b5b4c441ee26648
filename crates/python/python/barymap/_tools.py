"""Splines, decals, charts, pairs."""

from __future__ import annotations

import json
from typing import Any, Dict, List, NamedTuple, Optional, Union

import numpy as np
import numpy.typing as npt

from . import _anchors as given
from . import _barymap
from . import _inputs as take
from ._anchors import Points
from ._mesh import Mesh, mesh_of


class Curve(NamedTuple):
    """A curve on a mesh, as a polyline whose segments lie in one triangle each.

    vertices : (n, 3) float64
    points : the same as points of the surface
    parameters : (n,) float64, 0 to 1
    runs : (r,) int64, where each connected run begins
    report : length, jumps, and the distances by which control points were moved
    """

    vertices: npt.NDArray[np.float64]
    points: Points
    parameters: npt.NDArray[np.float64]
    runs: npt.NDArray[np.int64]
    report: Dict[str, Any]


def spline(
    mesh: Any,
    points: Any,
    *,
    kind: str = "bspline",
    degree: Optional[int] = None,
    closed: bool = False,
    mode: str = "direct",
    tolerance: float = 1e-5,
    samples: int = 0,
    landmarks: int = 2000,
    sampling: str = "decimation",
    dimension: int = 8,
    memory: Union[int, str] = "4G",
    cache: bool = True,
    progress: Any = None,
) -> Curve:
    """A B-spline or Bezier curve on a mesh by control points on it.

    points : vertices (k,), positions (k, 3), ``(faces, barycentric)``, or a list as in a JSON file
    kind : {"bspline", "bezier"}
    degree : 3 without, or of Bezier curves a single piece
    mode : {"direct", "subdivision"}
    tolerance : largest distance of the curve from its polyline, in diagonals of the mesh
    """
    surface = mesh_of(mesh, "mesh")
    curve = {
        "kind": take.word(kind, "kind"),
        "degree": 0 if degree is None else take.whole(degree, "degree", 1, 15),
        "closed": bool(closed),
        "mode": take.word(mode, "mode"),
        "tolerance": take.number(tolerance, "tolerance"),
        "samples": take.whole(samples, "samples", 0, 1 << 24),
    }
    at, places, parameters, runs, report = _barymap.spline(
        surface._shape,
        given.side(points, "points"),
        curve,
        take.embedded(landmarks, sampling, dimension),
        take.common("cpu", None, memory, cache),
        take.progress(progress),
    )
    return Curve(at, Points(*places), parameters, runs, json.loads(report))


class Decal(NamedTuple):
    """A texture with a picture on it.

    image : (h, w, c)
    report : ``shown``, ``stretch_all``, ``mirrored`` ...
    """

    image: npt.NDArray[Any]
    report: Dict[str, Any]


def decal(
    mesh: Any,
    image: npt.ArrayLike,
    anchors: Any,
    uv: Optional[npt.ArrayLike] = None,
    *,
    texture: Optional[npt.ArrayLike] = None,
    layout: str = "plate",
    size: take.Size = 2048,
    opacity: float = 1.0,
    material: Optional[str] = None,
    margin: int = 16,
    filter: str = "anisotropic",
    supersample: int = 1,
    linear_light: bool = False,
    backend: str = "auto",
    adapter: Optional[str] = None,
    memory: Union[int, str] = "4G",
    progress: Any = None,
) -> Decal:
    """A picture laid onto a part of a surface, drawn into its texture.

    anchors : points of the mesh, as :func:`spline` takes them
    uv : (k, 2), their places in the picture's unit square, v up; without it four anchors are its
        corners, counter-clockwise from the lower left
    texture : (h, w, c), the texture so far; without it the decal alone on transparent ground
    """
    surface = mesh_of(mesh, "mesh")
    picture, back = take.picture(image, "image")
    side = given.side(anchors, "anchors")
    base = None
    if texture is not None:
        base, back = take.picture(texture, "texture")
        width, height = base.shape[1], base.shape[0]
    else:
        width, height = take.size(size)
    look = {
        "layout": take.word(layout, "layout"),
        "width": width,
        "height": height,
        "opacity": take.number(opacity, "opacity"),
        "margin": take.whole(margin, "margin", 0, 16384),
        "filter": take.word(filter, "filter"),
        "supersample": take.whole(supersample, "supersample", 1, 4),
        "linear_light": bool(linear_light),
        "material": None if material is None else take.word(material, "material"),
    }
    made, report = _barymap.decal(
        surface._shape,
        picture,
        side,
        None if uv is None else take.floats(uv, "uv", (len(side["ids"]), 2)),
        base,
        look,
        take.common(backend, adapter, memory, True),
        take.progress(progress),
    )
    return Decal(take.like(back(made)), json.loads(report))


def unwrap(
    mesh: Any,
    *,
    size: int = 2048,
    margin: int = 16,
    chart_angle: float = 70.0,
    memory: Union[int, str] = "4G",
) -> Mesh:
    """The mesh with new texture coordinates: charts without overlaps, flattened and packed.

    size : side of the square texture that ``margin`` is meant for, in texels
    margin : texels between charts
    chart_angle : largest angle between a face and the mean of its chart, in degrees

    ``report`` of the result tells of charts and distortion.

    >>> import barymap
    >>> corners = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]
    >>> mesh = barymap.unwrap(barymap.Mesh(corners, [[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]]), size=256)
    >>> mesh.uv.shape, mesh.report["overlapping_faces"]
    ((4, 3, 2), [])
    """
    made, report = _barymap.unwrap(
        mesh_of(mesh, "mesh")._shape,
        take.whole(size, "size", 1),
        take.whole(margin, "margin", 0, 16384),
        take.number(chart_angle, "chart_angle"),
        take.common("cpu", None, memory, True),
    )
    result = Mesh._of(made)
    result.report = json.loads(report)
    return result


class Pairs(NamedTuple):
    """Pairs of anchors, which :class:`Map` takes as they are.

    source, target : points
    report : ``outliers``, ``pairs`` (origin, expected error, why doubtful), ``suggestions``
    """

    source: Points
    target: Points
    report: Dict[str, Any]

    @property
    def doubtful(self) -> List[int]:
        """Numbers of the pairs that are doubtful."""
        return [k for k, pair in enumerate(self.report.get("pairs", [])) if pair["flagged"]]


def anchors(
    source: Any,
    target: Any,
    anchors: Any = None,
    *,
    count: int = 64,
    ignore_connectivity: bool = False,
    check: bool = False,
    drop_outliers: bool = False,
    suggest: int = 0,
    landmarks: int = 2000,
    sampling: str = "decimation",
    dimension: int = 8,
    memory: Union[int, str] = "4G",
    cache: bool = True,
    progress: Any = None,
) -> Pairs:
    """Pairs of anchors proposed from a few or none, wrong ones named, the next ones suggested.

    anchors : pairs that are known, as :class:`Map` takes them
    check : only look at the given pairs: ``report["outliers"]``, ``"at_odds"`` (a number where most
        are wrong, so that none can be named) and ``"too_few"`` (to tell)
    suggest : this many places of the target where a pair would help most: ``report["suggestions"]``
    """
    wanted = {
        "count": take.whole(count, "count", 1, 1000),
        "connectivity": not ignore_connectivity,
        "check": bool(check),
        "drop_outliers": bool(drop_outliers),
        "suggest": take.whole(suggest, "suggest", 0, 1000),
    }
    on_source, on_target, report = _barymap.anchors(
        mesh_of(source, "source")._shape,
        mesh_of(target, "target")._shape,
        given.optional(anchors),
        wanted,
        take.embedded(landmarks, sampling, dimension),
        take.common("cpu", None, memory, cache),
        take.progress(progress),
    )
    return Pairs(Points(*on_source), Points(*on_target), json.loads(report))


def read_image(path: take.Path) -> npt.NDArray[Any]:
    """A picture of a file, (h, w) or (h, w, c), as it is stored: uint8, uint16 or float32. PNG,
    JPEG, TIFF, EXR, WebP, TGA, BMP, GIF, QOI, HDR, PNM."""
    return take.like(_barymap.read_picture(take.path(path, "path")))


def write_image(path: take.Path, image: npt.ArrayLike) -> None:
    """Writes a picture, whole or not at all: PNG, JPEG, TIFF, EXR, WebP, TGA, BMP or QOI."""
    array, _ = take.picture(image, "image")
    _barymap.write_picture(take.path(path, "path"), array)
