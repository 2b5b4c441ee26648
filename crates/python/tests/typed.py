"""What users write, as mypy sees it: run by tests/python.sh on the installed package."""

from typing import Any, Dict

import numpy as np
import numpy.typing as npt

import barymap


def textured(source: barymap.Mesh, target: barymap.Mesh, pairs: npt.NDArray[np.int64]) -> npt.NDArray[Any]:
    """Four lines with their types."""
    made = barymap.Map(source, target, pairs, progress=lambda stage, done, total: None)
    result: barymap.Transfer = made.transfer({"base_color": np.zeros((8, 8, 3))}, size=(64, 32))
    coverage: npt.NDArray[np.uint8] = result.coverage
    faces: npt.NDArray[np.int32] = made.apply([0], [[1, 0, 0]]).faces
    report: Dict[str, Any] = made.report
    return result["base_color"][: len(coverage) + len(faces) + len(report)]


def posed(mesh: barymap.Mesh) -> npt.NDArray[np.float64]:
    """A pose and its error."""
    try:
        return barymap.Encoding(mesh, [0, 1]).deform([[0, 0, 0], [1, 1, 1]]).vertices
    except barymap.InputError as error:
        raise SystemExit(f"{error.what}: {error.remedy}") from error
