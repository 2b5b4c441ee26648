"""The compiled half: arrays in and out, checked by the modules beside it."""

from typing import Any, Callable, Dict, List, Optional, Tuple, Union

import numpy as np
import numpy.typing as npt

__version__: str

_F64 = npt.NDArray[np.float64]
_U32 = npt.NDArray[np.uint32]
_Options = Dict[str, Any]
_Given = Union[str, Tuple[_Options, _Options]]
_Places = Tuple[npt.NDArray[np.int32], _F64]
_Images = Tuple[npt.NDArray[np.int32], _F64, npt.NDArray[np.uint8], npt.NDArray[np.float32]]
_Progress = Optional[Callable[[str, int, int], object]]

class Shape:
    @staticmethod
    def from_arrays(
        name: str,
        vertices: _F64,
        faces: _U32,
        uv: Optional[_F64],
        corners: Optional[_F64],
        uv_faces: Optional[_U32],
        tolerance: float,
    ) -> Shape: ...
    @staticmethod
    def open(path: str, tolerance: float, uv_set: Optional[int]) -> Shape: ...
    def moved(self, vertices: _F64) -> Shape: ...
    def write(self, path: str) -> None: ...
    @property
    def name(self) -> str: ...
    @property
    def notes(self) -> List[str]: ...
    @property
    def area(self) -> float: ...
    @property
    def materials(self) -> List[str]: ...
    @property
    def counts(self) -> Tuple[int, int]: ...
    @property
    def has_uv(self) -> bool: ...
    def vertices(self) -> _F64: ...
    def faces(self) -> npt.NDArray[np.int32]: ...
    def uv(self) -> Optional[_F64]: ...
    def colors(self) -> Optional[npt.NDArray[np.float32]]: ...

class PointMap:
    def __init__(
        self,
        source: Shape,
        target: Shape,
        anchors: _Given,
        chosen: _Options,
        embedded: _Options,
        common: _Options,
        progress: _Progress,
    ) -> None: ...
    def apply(self, faces: _U32, barycentric: _F64) -> _Images: ...
    def vertices(self) -> _Images: ...
    def inverse(self) -> Tuple[_Images, _F64]: ...
    def anchors(self) -> Tuple[_Places, _Places]: ...
    def report(self) -> str: ...

class Cage:
    def __init__(
        self, source: List[_F64], target: List[_F64], mapping: _Options, common: _Options, progress: _Progress
    ) -> None: ...
    def warp(
        self, picture: npt.NDArray[Any], look: _Options, progress: _Progress
    ) -> Tuple[npt.NDArray[Any], Optional[npt.NDArray[np.float32]], str]: ...
    def points(self, points: _F64, inverse: bool) -> Tuple[_F64, npt.NDArray[np.bool_], _F64]: ...
    def report(self) -> str: ...

class Poser:
    def __init__(
        self, mesh: Shape, vertices: List[int], region: Optional[List[int]], common: _Options, progress: _Progress
    ) -> None: ...
    @property
    def notes(self) -> List[str]: ...
    def deform(
        self, positions: _F64, name: str, stiffness: float, sweeps: int, warm: bool, progress: _Progress
    ) -> Tuple[_F64, str]: ...
    def animate(self, frames: _F64, name: str, stiffness: float, progress: _Progress) -> Tuple[_F64, List[int]]: ...

def transfer(
    map: PointMap, layers: List[_Options], named: List[str], own: bool, look: _Options, progress: _Progress
) -> Tuple[
    List[Tuple[str, npt.NDArray[Any]]], npt.NDArray[np.uint8], Optional[npt.NDArray[np.float32]], str
]: ...
def attributes(
    map: PointMap, values: _F64, kind: str, keep: int, fill: str, progress: _Progress
) -> Tuple[_F64, npt.NDArray[np.uint8]]: ...
def compatible(map: PointMap) -> Tuple[_F64, str]: ...
def morph(
    mesh: Shape,
    others: List[_F64],
    weights: List[List[float]],
    anchors: Optional[List[int]],
    name: str,
    common: _Options,
    progress: _Progress,
) -> _F64: ...
def spline(
    mesh: Shape, points: _Options, curve: _Options, embedded: _Options, common: _Options, progress: _Progress
) -> Tuple[_F64, _Places, _F64, npt.NDArray[np.int64], str]: ...
def decal(
    mesh: Shape,
    picture: npt.NDArray[Any],
    anchors: _Options,
    uv: Optional[_F64],
    texture: Optional[npt.NDArray[Any]],
    look: _Options,
    common: _Options,
    progress: _Progress,
) -> Tuple[npt.NDArray[Any], str]: ...
def unwrap(mesh: Shape, size: int, margin: int, chart_angle: float, common: _Options) -> Tuple[Shape, str]: ...
def anchors(
    source: Shape,
    target: Shape,
    given: Optional[_Given],
    wanted: _Options,
    embedded: _Options,
    common: _Options,
    progress: _Progress,
) -> Tuple[_Places, _Places, str]: ...
def program(arguments: List[str]) -> int: ...
def read_picture(path: str) -> npt.NDArray[Any]: ...
def write_picture(path: str, picture: npt.NDArray[Any]) -> None: ...
