"""Compares the time of the Python package with that of the command line: an estimate from a photo to a scene file.

Run it with the interpreter that has the package, and the program that was built with the same profile:

    target/python/bin/python python/benches/overhead.py target/release/lightoctree
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
import time
from pathlib import Path

ASSETS = Path(__file__).parents[2] / "apps/lightoctree-cli/assets"
PHOTO, DEPTH = ASSETS / "library_color.jpg", ASSETS / "library_lidar_depth.png"
REPEATS = 9
CODE = "import sys, lightoctree; lightoctree.estimate(sys.argv[1], depth=sys.argv[2] or None).save(sys.argv[3])"


def seconds(*command: object) -> float:
    """Returns the time of a process from start to end."""
    start = time.perf_counter()
    subprocess.run(list(map(str, command)), check=True, capture_output=True)
    return time.perf_counter() - start


def main(program: str) -> None:
    """Prints the least time of each of several alternating runs, and their ratio."""
    with tempfile.TemporaryDirectory() as folder:
        for name, depth in (("photo alone", None), ("photo with LiDAR depth", DEPTH)):
            given = ["--depth", depth] if depth else []
            times: list[tuple[float, float]] = []
            for _ in range(REPEATS):
                command = seconds(program, "estimate", PHOTO, *given, "-o", Path(folder, "cli.scene"), "--quiet")
                package = seconds(
                    sys.executable, "-W", "ignore", "-c", CODE, PHOTO, depth or "", Path(folder, "py.scene")
                )
                times.append((command, package))
            assert Path(folder, "cli.scene").read_bytes() == Path(folder, "py.scene").read_bytes()
            command, package = (min(column) for column in zip(*times, strict=True))
            print(f"{name}: command {command:.3f} s, Python {package:.3f} s, ratio {package / command:.3f}")


if __name__ == "__main__":
    main(*sys.argv[1:])
