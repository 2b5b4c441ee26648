"""Bad inputs raise, name the argument and a remedy, and leave the interpreter as it was."""

import pickle

import numpy as np
import pytest
from conftest import sphere

import barymap

VERTICES, FACES, UV = sphere(8, 4)
NAN = float("nan")


def mesh(**changes):
    return barymap.Mesh(**{"vertices": VERTICES, "faces": FACES, "uv": UV, **changes})


def changed(array, at, value):
    array = np.array(array, float)
    array[at] = value
    return array


PLAIN = mesh()
FLAT = barymap.Mesh(VERTICES, FACES)
SQUARE = [[0, 0], [8, 0], [8, 8], [0, 8]]
PICTURE = np.zeros((8, 8, 3), np.uint8)
IDS = [[0, 0], [1, 1], [4, 4], [8, 8], [12, 12]]


def a_map(*arguments, **options):
    return barymap.Map(*(arguments or (PLAIN, PLAIN, IDS)), **{"landmarks": 20, "backend": "cpu", **options})


def transfer(images=PICTURE, **options):
    return a_map().transfer(images, **{"size": 16, **options})


def encoding(**options):
    return barymap.Encoding(FLAT, [0, 1, 4, 8], cache=False, backend="cpu", **options)


REST = VERTICES[[0, 1, 4, 8]]

BAD = {
    # Meshes.
    "no vertices": lambda: mesh(vertices=[]),
    "vertices in the plane": lambda: mesh(vertices=VERTICES[:, :2]),
    "vertices that are text": lambda: mesh(vertices=[["a", "b", "c"]]),
    "vertices of unequal length": lambda: mesh(vertices=[[0, 0, 0], [1, 0]]),
    "complex vertices": lambda: mesh(vertices=VERTICES * 1j),
    "a vertex that is not finite": lambda: mesh(vertices=changed(VERTICES, (3, 1), NAN)),
    "a face beyond the vertices": lambda: mesh(faces=changed(FACES, (2, 1), 99)),
    "a negative face": lambda: mesh(faces=changed(FACES, (2, 1), -1)),
    "a face that is not whole": lambda: mesh(faces=changed(FACES, (2, 1), 0.5)),
    "a face beyond 32 bits": lambda: mesh(faces=changed(FACES, (2, 1), 2**33)),
    "quads": lambda: mesh(faces=[[0, 1, 2, 3]]),
    "no faces": lambda: mesh(faces=np.zeros((0, 3), int), uv=None),
    "faces without area": lambda: mesh(faces=[[0, 0, 0]], uv=None),
    "uv of another length": lambda: mesh(uv=UV[:-1]),
    "uv a vertex of another length": lambda: mesh(uv=VERTICES[1:, :2]),
    "uv indices beyond their list": lambda: mesh(uv=(VERTICES[:2, :2], FACES)),
    "uv that is not finite": lambda: mesh(uv=changed(UV, (1, 1, 1), np.inf)),
    "a negative tolerance": lambda: mesh(weld=-1),
    "a tolerance longer than the edges": lambda: mesh(weld=1e6),
    "a name that is none": lambda: mesh(name=7),
    "a file that is not there": lambda: barymap.read("/nonexistent/no.obj"),
    "a file that is no mesh": lambda: barymap.read(__file__),
    "a path that is none": lambda: barymap.read(3),
    "an object that is no mesh": lambda: a_map(object(), PLAIN, IDS),
    "an extension of no format": lambda: PLAIN.write("/tmp/mesh.xyz"),
    "a folder that is not there": lambda: PLAIN.write("/nonexistent/mesh.obj"),
    "another number of vertices": lambda: PLAIN.with_vertices(VERTICES[1:]),
    # Pairs.
    "no pairs": lambda: a_map(PLAIN, PLAIN, []),
    "pairs of three": lambda: a_map(PLAIN, PLAIN, [[0, 1, 2]]),
    "a pair beyond the vertices": lambda: a_map(PLAIN, PLAIN, [[0, 999]]),
    "sides of unequal length": lambda: a_map(PLAIN, PLAIN, ([0, 1], [0])),
    "a side that is missing": lambda: a_map(PLAIN, PLAIN, {"source": [1]}),
    "an anchor of no form": lambda: a_map(PLAIN, PLAIN, {"source": [{"at": 1}], "target": [1]}),
    "coordinates that do not sum to one": lambda: a_map(PLAIN, PLAIN, (([0], [[0.5, 0.5, 0.5]]), [0])),
    "a position that is not finite": lambda: a_map(PLAIN, PLAIN, ([[NAN, 0, 0]], [0])),
    "a position far away": lambda: a_map(PLAIN, PLAIN, ([[1e9, 0, 0]], [0])),
    "a file of pairs that is not there": lambda: a_map(PLAIN, PLAIN, "no.json"),
    # Maps.
    "an unknown method": lambda: a_map(method="magic"),
    "an unknown back end": lambda: a_map(backend="abacus"),
    "an adapter that is not there": lambda: a_map(backend="gpu", adapter="no such adapter"),
    "too few landmarks": lambda: a_map(landmarks=1),
    "an odd dimension": lambda: a_map(PLAIN, barymap.Mesh(*sphere(9, 4)), IDS, dimension=7),
    "no room": lambda: a_map(PLAIN, barymap.Mesh(*sphere(9, 4)), IDS).transfer(PICTURE, size=2048, memory=1000),
    "memory that is none": lambda: a_map(memory="lots"),
    "an option for another method": lambda: a_map(
        PLAIN, barymap.Mesh(*sphere(9, 4)), IDS, method="closest", align=True
    ),
    "a callback that is none": lambda: a_map(progress=3),
    "a point on no face": lambda: a_map().apply([999], [[1, 0, 0]]),
    "a point off its face": lambda: a_map().apply([0], [[2, -1, 0]]),
    "points of unequal length": lambda: a_map().apply([0, 1], [[1, 0, 0]]),
    # Transfers.
    "a picture of five channels": lambda: transfer(np.zeros((8, 8, 5))),
    "a picture of one row": lambda: transfer(np.zeros(8)),
    "a picture without pixels": lambda: transfer(np.zeros((0, 8, 3))),
    "a picture of large integers": lambda: transfer(np.full((8, 8, 3), 1 << 20)),
    "a picture of text": lambda: transfer(np.array([["a"]])),
    "a picture beyond single precision": lambda: transfer(np.full((8, 8, 3), 1e300)),
    "no size": lambda: transfer(size=0),
    "a size too large": lambda: transfer(size=1 << 20),
    "a size of three": lambda: transfer(size=(1, 2, 3)),
    "an unknown filter": lambda: transfer(filter="soap"),
    "an unknown kind": lambda: transfer(kind="smell"),
    "an unknown fill": lambda: transfer(fill="sand"),
    "fill of doubtful without fill": lambda: transfer(fill_doubtful=True),
    "five samples": lambda: transfer(supersample=5),
    "normals of one channel": lambda: transfer({"normal": np.zeros((8, 8))}),
    "no pictures": lambda: transfer({}),
    "a target without uv": lambda: a_map(PLAIN, FLAT, IDS).transfer(PICTURE, size=16),
    "a background of six": lambda: transfer(background=[1] * 6),
    "materials without textures": lambda: transfer(None),
    # Data of vertices.
    "data of another length": lambda: a_map().transfer_attributes([1, 2, 3]),
    "data that are not finite": lambda: a_map().transfer_attributes(changed(VERTICES, (0, 0), NAN)),
    "negative weights": lambda: a_map().transfer_attributes(-np.ones((len(VERTICES), 2)), kind="weights"),
    "vectors of two columns": lambda: a_map().transfer_attributes(VERTICES[:, :2], kind="vectors"),
    "an unknown kind of data": lambda: a_map().transfer_attributes(VERTICES, kind="smell"),
    # Cages.
    "a cage of two vertices": lambda: barymap.Cage(SQUARE[:2], SQUARE[:2]),
    "cages of unequal length": lambda: barymap.Cage(SQUARE, SQUARE[:3]),
    "a cage that crosses itself": lambda: barymap.Cage([SQUARE[i] for i in (0, 2, 1, 3)], SQUARE),
    "a cage that is not finite": lambda: barymap.Cage(changed(SQUARE, (0, 0), NAN), SQUARE),
    "an unknown partition": lambda: barymap.Cage(SQUARE, SQUARE, partition="uniform:0"),
    "a proof of other coordinates": lambda: barymap.Cage(SQUARE, SQUARE, certify=True, coordinates="wachspress"),
    "points in space": lambda: barymap.warp_points(VERTICES, SQUARE, SQUARE),
    "a time beyond the end": lambda: barymap.Cage(SQUARE, SQUARE).warp(PICTURE, time=2),
    "unknown units": lambda: barymap.warp(PICTURE, SQUARE, SQUARE, units="mile"),
    # Poses.
    "a handle beyond the vertices": lambda: barymap.Encoding(FLAT, [999]),
    "no handles": lambda: barymap.Encoding(FLAT, []),
    "poses without handles": lambda: barymap.Encoding(FLAT).deform(REST),
    "positions of another length": lambda: encoding().deform(REST[1:]),
    "positions that are not finite": lambda: encoding().deform(REST * NAN),
    "an unknown quality": lambda: encoding().deform(REST, quality="best"),
    "a negative stiffness": lambda: encoding().deform(REST, stiffness=-1),
    "frames of another length": lambda: encoding().animate(REST[None, 1:]),
    "blends of nothing": lambda: barymap.Encoding(FLAT).morph([]),
    "blends of another mesh": lambda: barymap.Encoding(FLAT).morph([VERTICES[1:]]),
    "weights of another length": lambda: barymap.Encoding(FLAT).morph([VERTICES], weights=[[1]]),
    "no frames": lambda: barymap.Encoding(FLAT).morph([VERTICES], frames=0),
    # Tools.
    "one control point": lambda: barymap.spline(PLAIN, [0], landmarks=20),
    "a degree of zero": lambda: barymap.spline(PLAIN, [0, 4, 8, 12], degree=0, landmarks=20),
    "three corners": lambda: barymap.decal(PLAIN, PICTURE, [0, 4, 8], size=16),
    "a decal on nothing": lambda: barymap.decal(FLAT, PICTURE, [2, 3, 11, 10], size=16),
    "an opacity of two": lambda: barymap.decal(PLAIN, PICTURE, [2, 3, 11, 10], size=16, opacity=2),
    "charts of no size": lambda: barymap.unwrap(PLAIN, size=0),
    "charts of any angle": lambda: barymap.unwrap(PLAIN, chart_angle=500),
    "more pairs than there may be": lambda: barymap.anchors(PLAIN, PLAIN, count=5000),
    "a picture that is not there": lambda: barymap.read_image("no.png"),
    "a picture of no format": lambda: barymap.write_image("/tmp/no.xyz", PICTURE),
}


@pytest.mark.parametrize("name", BAD)
def test_bad_input_raises(name):
    with pytest.raises(barymap.BarymapError) as caught:
        BAD[name]()
    error = caught.value
    assert not isinstance(error, (barymap.InternalError, barymap.CancelledError)), error
    assert error.what and error.remedy and error.what in str(error) and error.remedy in str(error)
    assert "--" not in str(error), "the words of the command line"
    again = pickle.loads(pickle.dumps(error))
    assert (again.what, again.where, again.remedy) == (error.what, error.where, error.remedy)


def test_there_are_more_than_fifty():
    assert len(BAD) > 50


def test_classes_are_those_that_people_catch():
    for name, kind in [
        ("a face beyond the vertices", ValueError),
        ("a file that is not there", OSError),
        ("no room", MemoryError),
        ("an adapter that is not there", RuntimeError),
    ]:
        with pytest.raises(kind):
            BAD[name]()


def test_the_argument_is_named():
    for name, where in [
        ("uv of another length", "uv"),
        ("an unknown method", "method"),
        ("an unknown filter", "filter"),
        ("data that are not finite", "values"),
        ("a file that is not there", "/nonexistent/no.obj"),
    ]:
        with pytest.raises(barymap.BarymapError) as caught:
            BAD[name]()
        assert caught.value.where == where, name
