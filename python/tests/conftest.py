"""The bundled photo at a quarter of its size, with its LiDAR depth, and the scene of both."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from PIL import Image

import lightoctree

ROOT = Path(__file__).parents[2]
ASSETS = ROOT / "apps/lightoctree-cli/assets"
PROGRAM = Path(sys.executable).with_name("lightoctree")

Cli = Callable[..., subprocess.CompletedProcess[str]]


@pytest.fixture(scope="session")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("inputs")


@pytest.fixture(scope="session")
def photo(folder: Path) -> Path:
    """A photo of 480 × 360 pixels with its EXIF, as PNG."""
    with Image.open(ASSETS / "library_color.jpg") as full:
        small = full.resize((480, 360), Image.Resampling.BOX)
        small.save(folder / "photo.png", exif=full.getexif())
    return folder / "photo.png"


@pytest.fixture(scope="session")
def depth(folder: Path) -> Path:
    """Depth of 256 × 192 pixels in millimetres."""
    file = folder / "depth.png"
    file.write_bytes((ASSETS / "library_lidar_depth.png").read_bytes())
    return file


@pytest.fixture(scope="session")
def scene_file(folder: Path, photo: Path, depth: Path) -> Path:
    lightoctree.estimate(photo, depth=depth).save(folder / "room.scene")
    return folder / "room.scene"


@pytest.fixture
def scene(scene_file: Path) -> lightoctree.Scene:
    return lightoctree.Scene.load(scene_file)


@pytest.fixture
def cli(tmp_path: Path) -> Cli:
    """Runs the command of the wheel in a temporary folder."""

    def run(*args: object, status: int = 0) -> subprocess.CompletedProcess[str]:
        done = run_program(PROGRAM, tmp_path, *args)
        assert done.returncode == status, done.stderr
        return done

    return run


def run_program(program: Path | str, folder: Path, *args: object) -> subprocess.CompletedProcess[str]:
    env = {name: value for name, value in os.environ.items() if name != "PYTHONWARNINGS"}
    return subprocess.run([program, *map(str, args)], cwd=folder, env=env, capture_output=True, text=True, check=False)
