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
REPEATS = 15
CODE = """
import sys, time, lightoctree
start = time.perf_counter()
lightoctree.estimate(sys.argv[1], depth=sys.argv[2] or None).save(sys.argv[3])
print(time.perf_counter() - start)
"""


def run(*command: object) -> tuple[float, str]:
    """Returns the time of a process from start to end, and what it prints."""
    start = time.perf_counter()
    done = subprocess.run(list(map(str, command)), check=True, capture_output=True, text=True)
    return time.perf_counter() - start, done.stdout


def main(program: str) -> None:
    """Prints the least times of alternating runs: of the command, of the call, and of the interpreter with the call."""
    with tempfile.TemporaryDirectory() as folder:
        files = [Path(folder, name) for name in ("command.scene", "python.scene")]
        for name, depth in (("photo alone", None), ("photo with LiDAR depth", DEPTH)):
            given = ["--depth", depth] if depth else []
            times: list[tuple[float, float, float]] = []
            for _ in range(REPEATS):
                command, _ = run(program, "estimate", PHOTO, *given, "-o", files[0], "--quiet")
                process, call = run(sys.executable, "-W", "ignore", "-c", CODE, PHOTO, depth or "", files[1])
                times.append((command, float(call), process))
            assert files[0].read_bytes() == files[1].read_bytes()
            command, duration, process = (min(column) for column in zip(*times, strict=True))
            print(f"{name}: command {command:.3f} s, call {duration:.3f} s, interpreter and call {process:.3f} s")


if __name__ == "__main__":
    main(*sys.argv[1:])
