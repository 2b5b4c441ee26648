"""barymap: one shape onto another from a handful of control points.

Four lines carry a texture from one mesh to another::

    import barymap
    source, target = barymap.read("source.obj"), barymap.read("target.obj")
    skin = barymap.Map(source, target, "pairs.json").transfer("skin.png", size=1024)
    barymap.write_image("new.png", skin.image)

Pictures are arrays (height, width, channels) with row 0 at the top, points arrays (n, 3) in the
units of their mesh, texture coordinates have v = 1 at the top. Arguments have the names and
defaults of the command line, which is ``python -m barymap``. Nothing is printed.
"""

from . import errors
from ._anchors import Points
from ._barymap import __version__
from ._cage import Cage, Moved, Warped, certify, warp, warp_points
from ._encoding import Encoding, Played, Pose
from ._map import DOUBTFUL, FAILED, FILLED, VALID, Attributes, Images, Map, Transfer
from ._mesh import Mesh, read
from ._tools import Curve, Decal, Pairs, anchors, decal, read_image, spline, unwrap, write_image
from .errors import (
    BarymapError,
    CancelledError,
    DeviceError,
    FileError,
    FormatError,
    IncompleteError,
    InputError,
    InternalError,
    MeshError,
    NumericError,
    OptionError,
    TooLargeError,
    UnusableError,
)

__all__ = [
    "Attributes",
    "BarymapError",
    "Cage",
    "CancelledError",
    "Curve",
    "DOUBTFUL",
    "Decal",
    "DeviceError",
    "Encoding",
    "FAILED",
    "FILLED",
    "FileError",
    "FormatError",
    "Images",
    "IncompleteError",
    "InputError",
    "InternalError",
    "Map",
    "Mesh",
    "MeshError",
    "Moved",
    "NumericError",
    "OptionError",
    "Pairs",
    "Played",
    "Points",
    "Pose",
    "TooLargeError",
    "Transfer",
    "UnusableError",
    "VALID",
    "Warped",
    "__version__",
    "anchors",
    "certify",
    "decal",
    "errors",
    "read",
    "read_image",
    "spline",
    "unwrap",
    "warp",
    "warp_points",
    "write_image",
]
