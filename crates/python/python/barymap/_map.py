"""Maps between meshes, and what they carry."""

from __future__ import annotations

import json
from typing import Any, Dict, Iterator, List, Mapping, NamedTuple, Optional, Tuple, Union

import numpy as np
import numpy.typing as npt

from . import _anchors as given
from . import _barymap
from . import _inputs as take
from ._anchors import Points
from ._mesh import Mesh, mesh_of
from .errors import InputError, OptionError

#: Status of an image or vertex.
FAILED, DOUBTFUL, VALID, FILLED = 0, 1, 2, 3


class Images(NamedTuple):
    """Where points lie on the other mesh.

    faces : (n,) int32, triangles, -1 where nothing was found
    barycentric : (n, 3) float64, coordinates in them, 0 where nothing was found
    status : (n,) uint8: 2 the map vouches for it, 1 doubtful, 0 failed
    confidence : (n,) float32, 0 to 1
    """

    faces: npt.NDArray[np.int32]
    barycentric: npt.NDArray[np.float64]
    status: npt.NDArray[np.uint8]
    confidence: npt.NDArray[np.float32]


class Attributes(NamedTuple):
    """Data of vertices on the target.

    values : (n, columns), or (n,) where one column was given; NaN where nothing is known
    status : (n,) uint8: 0 failed, 1 doubtful, 2 valid, 3 filled
    """

    values: npt.NDArray[Any]
    status: npt.NDArray[np.uint8]


class Transfer(Mapping[str, npt.NDArray[Any]]):
    """Pictures of a transfer, by their roles.

    A picture is (height, width, channels), or (height, width) where it is grey, in the type that
    was given. RGB comes back as RGBA: alpha is 0 where the target shows nothing.

    coverage : (height, width) uint8: 0 nothing, 64 padding, 128 doubtful or filled, 255 valid
    stmap : (height, width, 4) float32, u, v, coverage and whether there are coordinates; or None
    report : counts, fractions and seconds, as in the command line's ``--report``
    """

    def __init__(
        self,
        pictures: Dict[str, npt.NDArray[Any]],
        coverage: npt.NDArray[np.uint8],
        stmap: Optional[npt.NDArray[np.float32]],
        report: Dict[str, Any],
    ) -> None:
        self._pictures = pictures
        self.coverage = coverage
        self.stmap = stmap
        self.report = report

    def __getitem__(self, role: str) -> npt.NDArray[Any]:
        return self._pictures[role]

    def __iter__(self) -> Iterator[str]:
        return iter(self._pictures)

    def __len__(self) -> int:
        return len(self._pictures)

    @property
    def image(self) -> npt.NDArray[Any]:
        """The first picture, or the only one."""
        return next(iter(self._pictures.values()))

    @property
    def valid_fraction(self) -> float:
        """Valid share of the covered area of the target."""
        return float(self.report["valid_fraction"])

    def __repr__(self) -> str:
        height, width = self.coverage.shape
        return f"Transfer({list(self)}, {width} x {height}, {100 * self.valid_fraction:.1f} % valid)"


Pictures = Union[None, str, npt.ArrayLike, Mapping[str, Any], List[str]]


def _background(value: Any) -> Optional[Tuple[float, float, float, float]]:
    if value is None or (isinstance(value, str) and value == "transparent"):
        return None
    if isinstance(value, str):
        raise OptionError(f"{value!r} is no colour", "background", "Give transparent, or 1 to 4 numbers from 0 to 1")
    color = take.floats(np.atleast_1d(np.asarray(value)), "background", (None,)).tolist()
    if len(color) in (1, 2):
        color = [color[0]] * 3 + color[1:]
    if len(color) == 3:
        color.append(1.0)
    if len(color) != 4:
        raise OptionError(f"it has {len(color)} numbers", "background", "Give 1 to 4 numbers")
    return (color[0], color[1], color[2], color[3])


class Map:
    """A map from the points of ``target`` to those of ``source``.

    Parameters
    ----------
    source, target : Mesh, path, or anything like a trimesh
        The source has the texture, the target receives it.
    anchors : array, tuple, dict or path
        Pairs of corresponding points: vertices (k, 2), source first; ``(source, target)``, each of
        them vertices (k,), positions (k, 3), or ``(faces, barycentric)``; a dictionary as in a JSON
        file; or the name of a file.
    method, relax, align, keep_all, anchor_error, mirror
        As the command line's ``--method`` and so on.
    landmarks, sampling, dimension
        Of the embeddings, which are made once a mesh and kept.
    backend : {"auto", "gpu", "cpu", "reference"}
    adapter : part of the name of an adapter
    memory : bytes, or a text such as "4G"; work that takes more is refused
    cache : whether embeddings are kept on the disk, as the command line keeps them
    progress : function ``(stage, done, total)``, or ``tqdm.tqdm``
        What it raises stops the work.

    Other threads of Python run meanwhile. Ctrl-C ends the work.

    >>> import barymap, numpy as np
    >>> corners = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]
    >>> square = barymap.Mesh(corners, [[0, 1, 2], [0, 2, 3]], [[0, 0], [1, 0], [1, 1], [0, 1]])
    >>> map = barymap.Map(square, square, [[0, 0], [2, 2]], backend="cpu")
    >>> images = map.apply([1], [[0.25, 0.25, 0.5]])
    >>> images.faces.tolist(), images.barycentric.tolist(), images.status.tolist()
    ([1], [[0.25, 0.25, 0.5]], [2])
    >>> map.vertex_positions().tolist() == square.vertices.tolist()
    True
    """

    def __init__(
        self,
        source: Any,
        target: Any,
        anchors: Any,
        *,
        method: str = "field",
        relax: Optional[bool] = None,
        align: bool = False,
        keep_all: bool = False,
        anchor_error: float = 0.0,
        mirror: bool = False,
        landmarks: int = 2000,
        sampling: str = "decimation",
        dimension: int = 8,
        backend: str = "auto",
        adapter: Optional[str] = None,
        memory: Union[int, str] = "4G",
        cache: bool = True,
        progress: Any = None,
    ) -> None:
        self._source, self._target = mesh_of(source, "source"), mesh_of(target, "target")
        chosen = {
            "method": take.word(method, "method"),
            "relax": None if relax is None else bool(relax),
            "align": bool(align),
            "keep_all": bool(keep_all),
            "anchor_error": take.number(anchor_error, "anchor_error"),
            "mirror": bool(mirror),
        }
        self._memory = take.memory(memory)
        self._map = _barymap.PointMap(
            self._source._shape,
            self._target._shape,
            given.pairs(anchors),
            chosen,
            take.embedded(landmarks, sampling, dimension),
            take.common(backend, adapter, memory, cache),
            take.progress(progress),
        )
        self._report: Optional[Dict[str, Any]] = None

    @property
    def source(self) -> Mesh:
        """The mesh that points are carried to."""
        return self._source

    @property
    def target(self) -> Mesh:
        """The mesh whose points are carried."""
        return self._target

    @property
    def anchors(self) -> Tuple[Points, Points]:
        """The pairs as they were found, on the source and on the target."""
        on_source, on_target = self._map.anchors()
        return Points(*on_source), Points(*on_target)

    def apply(self, faces: npt.ArrayLike, barycentric: npt.ArrayLike) -> Images:
        """Images on the source of points of the target: ``faces`` (n,), ``barycentric`` (n, 3)."""
        ids = take.indices(faces, "faces", (None,))
        points = take.floats(barycentric, "barycentric", (len(ids), 3))
        return Images(*self._map.apply(ids, points))

    def vertices(self) -> Images:
        """Images on the source of the target's vertices, (n,) of them."""
        return Images(*self._map.vertices())

    def vertex_positions(self) -> npt.NDArray[np.float64]:
        """The same in space, (n, 3); NaN where a vertex has no image."""
        images = self.vertices()
        corners = self._source.vertices[self._source.faces[images.faces]]
        points: npt.NDArray[np.float64] = np.einsum("nk,nkj->nj", images.barycentric, corners)
        points[images.faces < 0] = np.nan
        return points

    @property
    def status(self) -> npt.NDArray[np.uint8]:
        """Status of the images of the target's vertices, (n,): 2 valid, 1 doubtful, 0 failed."""
        return self.vertices().status

    @property
    def confidence(self) -> npt.NDArray[np.float32]:
        """Confidence in the images of the target's vertices, (n,), 0 to 1."""
        return self.vertices().confidence

    def inverse(self) -> Tuple[Images, npt.NDArray[np.float64]]:
        """For every vertex of the source the point of the target that goes there, and by how much
        it misses, over the square root of the source's area; NaN where there is none."""
        images, residuals = self._map.inverse()
        return Images(*images), residuals

    @property
    def report(self) -> Dict[str, Any]:
        """What there is to say of the map, as in the command line's ``--report``."""
        if self._report is None:
            self._report = json.loads(self._map.report())
        return dict(self._report)

    def transfer(
        self,
        images: Pictures = None,
        *,
        size: take.Size = 2048,
        margin: int = 16,
        fill: str = "none",
        fill_doubtful: bool = False,
        linear_light: bool = False,
        filter: str = "anisotropic",
        supersample: int = 1,
        stmap: bool = False,
        background: Any = "transparent",
        kind: Optional[str] = None,
        normal_y: str = "up",
        relief: str = "turned",
        memory: Union[int, str, None] = None,
        progress: Any = None,
    ) -> Transfer:
        """Pictures of the source as textures of the target.

        Parameters
        ----------
        images
            A picture (h, w) or (h, w, 1 to 4), row 0 at the top; or a dictionary of them by role,
            each alone or as ``(picture, kind)``; or texts as the command line's ``--texture`` has
            them (``"skin.png"``, ``"normal=n.png"``, ``"vertex-colors"``); or nothing, for the
            textures of the source's own materials. uint8, uint16 and float32 are worked on as they
            are; other floats in single precision, other integers as uint16 (0 to 65535).
        size : int or (width, height)
        margin : texels of padding around the charts
        fill : {"none", "smooth", "pull-push", "nearest"}
        kind : {"color", "labels", "normal", "normal-object", "displacement"}
            Without it, what the role says: ``normal``, ``label`` and ``displacement`` are that, all
            others colours.
        background : "transparent", or the stored value of texels without colour (0 to 1)

        All other arguments are the command line's. The types come back as they were given.

        >>> import barymap, numpy as np
        >>> corners, uv = [[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 0], [1, 0], [0, 1]]
        >>> one = barymap.Mesh(corners, [[0, 1, 2]], uv)
        >>> grey = np.full((4, 4), 7, np.uint8)
        >>> made = barymap.Map(one, one, [[0, 0]], backend="cpu").transfer(grey, size=8, background=0)
        >>> made.image.shape, made.image.dtype, int(made.image.max()), made.coverage.shape
        ((8, 8), dtype('uint8'), 7, (8, 8))
        """
        width, height = take.size(size)
        layers, named, backs = _layers(images, kind)
        look = {
            "width": width,
            "height": height,
            "margin": take.whole(margin, "margin", 0, 16384),
            "fill": take.word(fill, "fill"),
            "fill_doubtful": bool(fill_doubtful),
            "linear_light": bool(linear_light),
            "filter": take.word(filter, "filter"),
            "supersample": take.whole(supersample, "supersample", 1, 4),
            "stmap": bool(stmap),
            "background": _background(background),
            "normal_y": take.word(normal_y, "normal_y"),
            "relief": take.word(relief, "relief"),
            "memory": self._memory if memory is None else take.memory(memory),
        }
        made, coverage, st, report = _barymap.transfer(
            self._map, layers, named, images is None, look, take.progress(progress)
        )
        pictures = {role: take.like(backs.get(role, lambda a: a)(picture)) for role, picture in made}
        return Transfer(pictures, take.like(coverage), st, json.loads(report))

    def transfer_attributes(
        self,
        values: npt.ArrayLike,
        *,
        kind: str = "scalars",
        top: int = 0,
        fill: str = "smooth",
        progress: Any = None,
    ) -> Attributes:
        """Data of the source's vertices, (n,) or (n, columns), on the target's.

        kind : {"scalars", "weights", "labels", "vectors", "normals", "tangents", "colors"}
            Weights are divided by their sum; labels are never mixed; vectors (three columns each)
            turn as the surface does.
        top : how many weights of a vertex are kept, the largest ones; 0 for all
        fill : {"smooth", "none"}, what vertices get that the map does not vouch for

        >>> import barymap
        >>> one = barymap.Mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
        >>> barymap.Map(one, one, [[0, 0]], backend="cpu").transfer_attributes([5, 6, 7]).values.tolist()
        [5.0, 6.0, 7.0]
        """
        array = np.asarray(values)
        flat = array.ndim == 1
        count = self._source._shape.counts[0]
        table = take.floats(array[:, np.newaxis] if flat else values, "values", (count, None))
        keep = take.whole(top, "top", 0, 1 << 20)
        made, status = _barymap.attributes(
            self._map, table, take.word(kind, "kind"), keep, take.word(fill, "fill"), take.progress(progress)
        )
        return Attributes(made[:, 0] if flat else made, status)

    def compatible(self) -> Tuple[npt.NDArray[np.float64], Dict[str, Any]]:
        """The shape of the source with the vertices of the target, (n, 3), and what was mended: for
        blends of meshes of different connectivity (:meth:`Encoding.morph`)."""
        positions, report = _barymap.compatible(self._map)
        return positions, json.loads(report)

    def __repr__(self) -> str:
        return f"Map({self._target.name!r} -> {self._source.name!r}, {len(self.anchors[0])} pairs)"


def _layers(images: Any, kind: Optional[str]) -> Tuple[List[Dict[str, Any]], List[str], Dict[str, Any]]:
    layers: List[Dict[str, Any]] = []
    backs: Dict[str, Any] = {}
    if images is None:
        return layers, [], backs
    if isinstance(images, str):
        return layers, [images], backs
    if isinstance(images, (list, tuple)) and images and all(isinstance(text, str) for text in images):
        return layers, list(images), backs
    by_role = images if isinstance(images, Mapping) else {"base_color": images}
    if not by_role:
        raise InputError("there is none", "images", "Give a picture, or several by their roles")
    for role, value in by_role.items():
        role = take.word(role, "images, role")
        own = kind
        if isinstance(value, tuple) and len(value) == 2 and isinstance(value[1], str):
            value, own = value
        array, back = take.picture(value, f"images, {role}")
        layers.append({"role": role, "kind": own, "image": array})
        backs[role] = back
    return layers, [], backs
