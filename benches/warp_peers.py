#!/usr/bin/env python3
"""Times the filters of `barymap warp` beside OpenCV's remap: the same pictures, the same waves, pre-images given to both.

    python3 benches/warp_peers.py

OpenCV is taken as it is installed, or put into a virtual environment in the target folder. Our figures come from
`cargo bench --bench warp -- filters`, which this starts. CPU time / 2 on both sides, the best of several runs. OpenCV's only
Lanczos filter reads 8 x 8 pixels: ours of the same size, `lanczos4`, stands beside it, and `lanczos` with its 6 x 6 as well.
"""

import json
import os
import pathlib
import subprocess
import sys
import venv

ROOT = pathlib.Path(__file__).resolve().parent.parent
TARGET = pathlib.Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target"))

PEER = """
import json, time
import cv2
import numpy as np

cv2.setNumThreads(2)
y, x = np.mgrid[0:1080, 0:1920].astype(np.float32)
map_x = (x + 10 * np.sin(0.02 * (y + 0.5))).astype(np.float32)
map_y = (y + 10 * np.cos(0.02 * (x + 0.5))).astype(np.float32)
random = np.random.default_rng(1)
rates = {}
for name, channels, kind in [("u8x3", 3, np.uint8), ("u8x4", 4, np.uint8), ("u16x4", 4, np.uint16), ("f32x4", 4, np.float32)]:
    image = random.random((1080, 1920, channels), dtype=np.float32)
    image = image if kind == np.float32 else (image * np.iinfo(kind).max).astype(kind)
    for label, how in [("bilinear", cv2.INTER_LINEAR), ("lanczos4", cv2.INTER_LANCZOS4)]:
        best = float("inf")
        for _ in range(20):
            start = time.process_time()
            cv2.remap(image, map_x, map_y, how, borderMode=cv2.BORDER_REPLICATE)
            best = min(best, (time.process_time() - start) / 2)
        rates[name + " " + label] = 1920 * 1080 / best / 1e6
print(json.dumps({"version": cv2.__version__, "rates": rates}))
"""


def interpreter():
    """A Python that can import cv2."""
    for python in [sys.executable, str(TARGET / "peers" / "venv" / "bin" / "python")]:
        if os.path.exists(python) and subprocess.run([python, "-c", "import cv2"], capture_output=True).returncode == 0:
            return python
    folder = TARGET / "peers" / "venv"
    venv.create(folder, with_pip=True)
    python = str(folder / "bin" / "python")
    subprocess.run([python, "-m", "pip", "install", "--quiet", "opencv-python-headless"], check=True)
    return python


def ours():
    """Rates by picture and filter, from the bench's table."""
    command = ["cargo", "bench", "--bench", "warp", "--", "filters"]
    output = subprocess.run(command, cwd=ROOT, stdout=subprocess.PIPE, text=True, check=True).stdout
    rates = {}
    for line in output.splitlines():
        cells = [cell.strip() for cell in line.strip("|").split("|")]
        if len(cells) == 6 and cells[2] == "1":
            rates[cells[0] + " " + cells[1]] = float(cells[3])
    return rates


def main():
    """Runs both and prints a table."""
    rates = ours()
    peer = json.loads(subprocess.run([interpreter(), "-c", PEER], stdout=subprocess.PIPE, text=True, check=True).stdout)
    print(f"OpenCV {peer['version']}; 1920 x 1080, Mpixel/s by CPU time / 2")
    print("| picture | filters | pixels read | OpenCV | barymap | barymap / OpenCV |")
    print("|---|---|---|---|---|---|")
    pairs = [("bilinear", "bilinear", "4, 4"), ("lanczos4", "lanczos4", "64, 64"), ("lanczos4", "lanczos", "64, 36")]
    for picture in dict.fromkeys(name.split()[0] for name in peer["rates"]):
        for theirs, own, read in pairs:
            rate, our = peer["rates"][f"{picture} {theirs}"], rates[f"{picture} {own}"]
            print(f"| {picture} | {theirs}, {own} | {read} | {rate:.1f} | {our:.1f} | {our / rate:.2f} |")


if __name__ == "__main__":
    main()
