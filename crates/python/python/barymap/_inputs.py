"""Arguments as arrays: anything that numpy can read is taken, and what does not fit is named."""

from __future__ import annotations

import os
import sys
from typing import TYPE_CHECKING, Any, Callable, Optional, Sequence, Tuple, Union

import numpy as np
import numpy.typing as npt

from .errors import InputError, OptionError

if TYPE_CHECKING:
    from typing_extensions import TypeAlias

Floats: TypeAlias = "npt.NDArray[np.float64]"
Indices: TypeAlias = "npt.NDArray[np.uint32]"
ArrayLike: TypeAlias = "npt.ArrayLike"
Path = Union[str, "os.PathLike[str]"]
Size = Union[int, Tuple[int, int]]
Progress = Optional[Callable[[str, int, int], object]]

_LARGEST = 2**32 - 2


def _array(value: Any, name: str) -> npt.NDArray[Any]:
    try:
        array = np.asarray(value)
    except (ValueError, TypeError) as error:
        raise InputError(f"it is no array: {error}", name, "Give rows of equal length") from None
    if array.dtype.kind == "O":
        try:
            array = array.astype(np.float64)
        except (ValueError, TypeError):
            raise InputError("it is no array of numbers", name, "Give rows of equal length, of numbers") from None
    if array.dtype.kind not in "biuf":
        raise InputError(f"its values are {array.dtype}, no numbers", name, "Give real numbers")
    return array


def _shaped(array: npt.NDArray[Any], name: str, shape: Sequence[Optional[int]]) -> npt.NDArray[Any]:
    if array.size == 0 and shape[0] is None and 0 in array.shape[:1]:
        array = array.reshape((0, *(n or 0 for n in shape[1:])))
    fits = array.ndim == len(shape) and all(n is None or n == m for n, m in zip(shape, array.shape))
    if not fits:
        wanted = "(" + ", ".join("n" if n is None else str(n) for n in shape) + ("," if len(shape) == 1 else "") + ")"
        raise InputError(f"its shape is {array.shape}, not {wanted}", name, f"Give an array of shape {wanted}")
    return array


def floats(value: Any, name: str, shape: Sequence[Optional[int]], finite: bool = True) -> Floats:
    """A float64 array of the shape (``None`` for any length)."""
    array = _shaped(_array(value, name), name, shape)
    array = np.ascontiguousarray(array, dtype=np.float64)
    if finite and not np.isfinite(array).all():
        at = tuple(int(i) for i in np.argwhere(~np.isfinite(array))[0])
        raise InputError(f"the number at {list(at)} is {array[at]}", name, "Give finite numbers")
    return array


def indices(value: Any, name: str, shape: Sequence[Optional[int]]) -> Indices:
    """An array of indices: whole numbers from 0 on, of any type."""
    array = _shaped(_array(value, name), name, shape)
    if array.dtype.kind == "f":
        if not np.array_equal(array, np.floor(array)) or not np.isfinite(array).all():
            raise InputError("it holds numbers that are not whole", name, "Give indices, counted from 0")
    if array.size and (array.min() < 0 or array.max() > _LARGEST):
        bad = array.min() if array.min() < 0 else array.max()
        raise InputError(f"{bad} is no index", name, "Indices count from 0")
    return np.ascontiguousarray(array, dtype=np.uint32)


def number(value: Any, name: str) -> float:
    """A finite number."""
    try:
        result = float(value)
    except (TypeError, ValueError):
        raise OptionError(f"{value!r} is no number", name, "Give a number") from None
    if not np.isfinite(result):
        raise OptionError(f"it is {result}", name, "Give a finite number")
    return result


def whole(value: Any, name: str, least: int = 0, most: int = _LARGEST) -> int:
    """A whole number of a range."""
    try:
        result = int(value)
        same = result == value
    except (TypeError, ValueError, OverflowError):
        raise OptionError(f"{value!r} is no whole number", name, "Give a whole number") from None
    if not same or not least <= result <= most:
        raise OptionError(f"it is {value!r}", name, f"Give a whole number from {least} to {most}")
    return result


def word(value: Any, name: str) -> str:
    """A word."""
    if not isinstance(value, str):
        raise OptionError(f"{value!r} is no word", name, "Give a string")
    return value


def path(value: Any, name: str) -> str:
    """The name of a file."""
    try:
        return os.fsdecode(os.fspath(value))
    except TypeError:
        raise InputError(f"{value!r} is no path", name, "Give a string or a path") from None


def size(value: Any, name: str = "size") -> Tuple[int, int]:
    """Width and height: one number for a square, or two."""
    if isinstance(value, (tuple, list)):
        if len(value) != 2:
            raise OptionError(f"{value!r} is no size", name, "Give one number, or (width, height)")
        return whole(value[0], name, 1), whole(value[1], name, 1)
    side = whole(value, name, 1)
    return side, side


def memory(value: Any) -> int:
    """Bytes: a number, or a text such as ``4G``."""
    if isinstance(value, str):
        units = {"K": 10, "M": 20, "G": 30}
        text = value.strip().upper()
        shift = units.get(text[-1:], 0)
        digits = text[:-1] if shift else text
        if digits.isdigit() and int(digits) << shift <= 2**62:
            value = int(digits) << shift
    if isinstance(value, (str, bytes)):
        raise OptionError(f"{value!r} is no size", "memory", "Give 4G, 512M or a number of bytes")
    return whole(value, "memory", 1, 2**62)


def common(backend: Any, adapter: Any, memory_: Any, cache: Any) -> dict[str, Any]:
    """Where and within what work is done."""
    return {
        "backend": word(backend, "backend"),
        "adapter": None if adapter is None else word(adapter, "adapter"),
        "memory": memory(memory_),
        "cache": bool(cache),
    }


def embedded(landmarks: Any, sampling: Any, dimension: Any) -> dict[str, Any]:
    """Options of embeddings."""
    return {
        "landmarks": whole(landmarks, "landmarks", 4, 5000),
        "sampling": word(sampling, "sampling"),
        "dimension": whole(dimension, "dimension", 4, 16),
    }


def picture(value: Any, name: str) -> Tuple[npt.NDArray[Any], Callable[[npt.NDArray[Any]], npt.NDArray[Any]]]:
    """A picture (h, w, c) of uint8, uint16 or float32, and what makes the type of ``value`` of a
    result.

    Other floats go through float32, other integers through uint16, truth values through uint8.
    """
    array = _array(value, name)
    flat = array.ndim == 2
    if flat:
        array = array[:, :, np.newaxis]
    if array.ndim != 3 or not 1 <= array.shape[2] <= 4:
        remedy = "Give an array (height, width) or (height, width, 1 to 4)"
        raise InputError(f"its shape is {np.shape(value)}", name, remedy)
    if array.size == 0:
        raise InputError("it has no pixel", name, "Give a picture of at least one pixel")
    kind = array.dtype
    if kind == np.bool_:
        worked = array.astype(np.uint8) * np.uint8(255)
        back: Callable[[npt.NDArray[Any]], npt.NDArray[Any]] = lambda a: a >= 128
    elif kind.newbyteorder("=") in (np.dtype(np.uint8), np.dtype(np.uint16), np.dtype(np.float32)):
        worked = array.astype(kind.newbyteorder("="), copy=False)
        back = lambda a: a
    elif kind.kind == "f":
        with np.errstate(over="ignore"):
            worked = array.astype(np.float32)
        if not np.array_equal(np.isfinite(worked), np.isfinite(array)):
            raise InputError("some values are beyond single precision", name, "Scale them")
        back = lambda a: a.astype(kind)
    else:
        low, high = int(array.min()), int(array.max())
        if low < 0 or high > 65535:
            what = f"integers of it reach from {low} to {high}"
            raise InputError(what, name, "Give integers of 0 to 65535, or floats")
        worked = array.astype(np.uint16)
        limit = min(np.iinfo(kind).max, 65535)
        back = lambda a: np.minimum(a, limit).astype(kind)
    return np.ascontiguousarray(worked), back


def like(result: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """A grey picture as (h, w)."""
    return result[:, :, 0] if result.shape[2] == 1 else result


class _Bar:
    """Shows progress by a bar such as tqdm's."""

    def __init__(self, bar: Any) -> None:
        self._bar = bar() if isinstance(bar, type) else bar
        self._stage = ""

    def __call__(self, stage: str, done: int, total: int) -> None:
        if stage != self._stage:
            self._stage = stage
            self._bar.reset(total=total or None)
            self._bar.set_description(stage, refresh=False)
        self._bar.update(done - self._bar.n)


def progress(value: Any) -> Progress:
    """A callback ``(stage, done, total)``: a function as it is; a class or object like tqdm's is
    driven."""
    if value is None or value is False:
        return None
    if hasattr(value, "update") and hasattr(value, "set_description"):
        return _Bar(value)
    if not callable(value):
        raise OptionError(f"{value!r} cannot be called", "progress", "Give a function, or tqdm.tqdm")
    result: Progress = value
    return result


if sys.version_info < (3, 9):  # pragma: no cover
    raise ImportError("barymap needs Python 3.9 or later")
