"""The command `lightoctree` of the wheel."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from conftest import PROGRAM, Cli, run_program

import lightoctree

CARGO_PROGRAM = os.environ.get("LIGHTOCTREE_PROGRAM")


def test_exit_codes_and_output(cli: Cli, tmp_path: Path) -> None:
    assert lightoctree.__version__ in cli("--version").stdout
    assert "Usage: lightoctree" in cli("--help").stdout
    assert "unexpected argument" in cli("--nonsense", status=2).stderr
    assert "none.scene" in cli("inspect", "none.scene", status=1).stderr
    (tmp_path / "room.png").touch()
    assert cli("estimate", "room.png", "-o", "room.png", status=2).stderr.startswith("error: ")


@pytest.mark.skipif(CARGO_PROGRAM is None, reason="LIGHTOCTREE_PROGRAM does not name the program that cargo built")
def test_the_program_is_that_of_cargo(photo: Path, scene_file: Path, tmp_path: Path) -> None:
    """Compares exit code, output without times, and files of some commands."""
    assert CARGO_PROGRAM is not None
    commands: list[list[object]] = [
        ["--version"],
        ["--help"],
        ["estimate", "--help"],
        ["completions", "bash"],
        ["estimate", photo, "-o", "room.scene", "--quiet"],
        ["envmap", "room.scene", "--at", "0,0,-1", "-o", "light.exr", "--preview", "--quiet"],
        ["insert", "room.scene", "--mesh", "builtin:tea-set", "--pixel", "240,300", "-o", "tea.png", "--quiet"],
        ["probes", "room.scene", "--grid", "2,1,1", "--size", "64x32", "-o", "probes", "--quiet"],
        ["export", "room.scene", "--to", "glb", "-o", "room.glb", "--quiet"],
        ["inspect", scene_file],
        ["lights", scene_file, "--json"],
        ["envmap", "none.scene", "--at", "0,0,0", "-o", "none.exr"],
        ["envmap", "room.scene", "-o", "none.exr"],
    ]
    outputs: list[tuple[list[object], dict[Path, bytes]]] = []
    for program in (str(PROGRAM), CARGO_PROGRAM):
        folder = tmp_path / str(len(outputs))
        folder.mkdir()
        ran = [run_program(program, folder, *command) for command in commands]
        told: list[object] = [(done.returncode, without_times(done.stdout), done.stderr) for done in ran]
        files = {file.relative_to(folder): file.read_bytes() for file in folder.rglob("*") if file.is_file()}
        outputs.append((told, files))
    assert outputs[0][0] == outputs[1][0]
    assert outputs[0][1] == outputs[1][1] and len(outputs[0][1]) >= 7


def without_times(text: str) -> str:
    return re.sub(r" in [0-9.]+ m?s$", "", text, flags=re.MULTILINE)


@pytest.mark.skipif(sys.platform == "win32", reason="sends a POSIX signal")
def test_ctrl_c_stops_the_program(photo: Path, tmp_path: Path) -> None:
    arguments = [str(PROGRAM), "estimate", str(photo), "-o", "room.scene"]
    process = subprocess.Popen(arguments, cwd=tmp_path, stderr=subprocess.PIPE, text=True)
    assert process.stderr is not None
    # The handler is installed before the first stage.
    assert "read weights" in process.stderr.readline()
    process.send_signal(signal.SIGINT)
    start = time.monotonic()
    _, told = process.communicate()
    assert "stopping after the current step" in told and "error: cancelled" in told
    assert process.returncode == 1 and time.monotonic() - start < 30
    assert not (tmp_path / "room.scene").exists()
