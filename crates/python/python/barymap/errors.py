"""What goes wrong, as exceptions with fields.

Every exception of barymap has three fields: ``what`` is wrong, ``where`` (the argument, the file
with its line, the mesh; ``None`` where ``what`` says it), and ``remedy``, what to do about it.

>>> import barymap
>>> try:
...     barymap.Mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 3]])
... except barymap.MeshError as error:
...     print(error.what)
...     print(error.where)
...     print(error.remedy)
face 0, corner 2: there is no vertex 3, there are 3
mesh mesh
Indices count from 0: correct the index, or give what it names
"""

from __future__ import annotations

import re
from typing import Optional


def _as_arguments(text: str) -> str:
    """The library speaks of options of the command line (``--anchor-error``); here they are
    arguments (``anchor_error``)."""
    return re.sub(r"--([a-z][a-z]*(?:-[a-z]+)*)", lambda m: m[1].replace("-", "_"), text)


class BarymapError(Exception):
    """Any error of barymap."""

    what: str
    where: Optional[str]
    remedy: str

    def __init__(self, what: str, where: Optional[str] = None, remedy: str = "") -> None:
        self.what = _as_arguments(what).rstrip(".")
        self.where = where
        self.remedy = _as_arguments(remedy).rstrip(".")
        place = f"{where}: " if where else ""
        end = f". {self.remedy}" if self.remedy else ""
        super().__init__(f"{place}{self.what}{end}")

    def __reduce__(self) -> tuple[type, tuple[str, Optional[str], str]]:
        return (type(self), (self.what, self.where, self.remedy))


class InputError(BarymapError, ValueError):
    """An array, anchor or point does not fit."""


class OptionError(BarymapError, ValueError):
    """An argument has a value outside its range; ``where`` names it."""


class MeshError(BarymapError, ValueError):
    """A mesh cannot be used for what was asked."""


class FormatError(BarymapError, ValueError):
    """A file was read, but its content is not what its format asks for."""


class UnusableError(BarymapError, ValueError):
    """The input was read, and no result comes of it that would be of use."""


class IncompleteError(BarymapError):
    """Some of several results failed; all others are done."""


class NumericError(BarymapError, ArithmeticError):
    """A numerical step failed, or would give a number that is not finite."""


class FileError(BarymapError, OSError):
    """A file could not be opened, read or written; ``where`` is its path."""


class DeviceError(BarymapError, RuntimeError):
    """No graphics adapter can be used, or the device failed."""


class TooLargeError(BarymapError, MemoryError):
    """The work would take more than ``memory`` allows; it was not begun."""


class CancelledError(BarymapError):
    """The work was cancelled."""


class InternalError(BarymapError, RuntimeError):
    """A mistake of barymap."""
