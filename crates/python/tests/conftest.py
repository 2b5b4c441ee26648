"""What the tests share: the files of the demo, small spheres, the command line."""

import os
import subprocess
import sys

import numpy as np
import pytest

import barymap


def sphere(around, rows, radius=1.0):
    """A sphere with texture coordinates a corner: vertices, faces, uv (m, 3, 2)."""
    vertices, uv_of = [(0, 0, radius), (0, 0, -radius)], {}
    for r in range(1, rows):
        for k in range(around):
            theta, phi = np.pi * r / rows, 2 * np.pi * k / around
            at = (np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta))
            vertices.append(tuple(radius * x for x in at))
    number = lambda r, k: 0 if r == 0 else 1 if r == rows else 2 + (r - 1) * around + k % around
    faces, uv = [], []
    place = lambda r, k: (k / around, 1 - r / rows)
    for r in range(rows):
        for k in range(around):
            corners = [(r, k), (r + 1, k), (r + 1, k + 1), (r, k + 1)]
            for three in ([0, 1, 2], [0, 2, 3]):
                ids = [number(*corners[i]) for i in three]
                if len(set(ids)) == 3:
                    faces.append(ids)
                    uv.append([place(*corners[i]) for i in three])
    return np.array(vertices, float), np.array(faces), np.array(uv)


#: Poles and the ring of the equator, the same places on both spheres.
NET_SOURCE = [0, 1, *(2 + 5 * 24 + 4 * k for k in range(6)), *(2 + 2 * 24 + 4 * k for k in range(6))]
NET_TARGET = [0, 1, *(2 + 5 * 18 + 3 * k for k in range(6)), *(2 + 2 * 18 + 3 * k for k in range(6))]
PAIRS = np.array([NET_SOURCE, NET_TARGET]).T


@pytest.fixture(scope="session")
def spheres():
    """Two spheres of different connectivity, and pairs."""
    source = barymap.Mesh(*sphere(24, 12), name="source")
    target = barymap.Mesh(*sphere(18, 12, 2.0), name="target")
    return source, target, PAIRS


@pytest.fixture(scope="session")
def small(spheres):
    """A map between the spheres, which takes a moment to make."""
    return barymap.Map(*spheres, landmarks=60, backend="cpu")


def run(*arguments, cwd=None, check=True):
    """``python -m barymap``; returns the finished process."""
    done = subprocess.run(
        [sys.executable, "-m", "barymap", *map(str, arguments)], cwd=cwd, capture_output=True, text=True, stdin=subprocess.DEVNULL
    )
    if check and done.returncode != 0:
        raise AssertionError(f"{arguments}: exit {done.returncode}\n{done.stderr}")
    return done


@pytest.fixture(scope="session")
def program():
    """The command line."""
    return run


@pytest.fixture(scope="session")
def demo(tmp_path_factory):
    """The folder with the files of ``barymap demo``."""
    folder = tmp_path_factory.mktemp("demo")
    os.environ.setdefault("BARYMAP_CACHE", str(tmp_path_factory.mktemp("cache")))
    run("demo", "--size", "256", "--out", folder, "--quiet")
    return folder


@pytest.fixture(scope="session")
def checker():
    """A picture of 64 x 96 pixels in RGB."""
    y, x = np.mgrid[0:64, 0:96]
    return np.stack([x * 2, y * 3, (x // 8 + y // 8) % 2 * 255], axis=2).astype(np.uint8)
