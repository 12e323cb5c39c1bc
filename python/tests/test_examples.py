"""The examples run as written."""

from __future__ import annotations

import runpy
from pathlib import Path

import pytest
from conftest import ROOT
from PIL import Image

EXAMPLES = sorted((ROOT / "python/examples").glob("*.py"))


@pytest.mark.parametrize("example", EXAMPLES, ids=lambda example: example.stem)
def test_example_runs(example: Path, photo: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with Image.open(photo) as image:
        image.save(tmp_path / "photo.jpg", exif=image.getexif())
    monkeypatch.chdir(tmp_path)
    runpy.run_path(str(example))


def test_there_are_examples() -> None:
    assert len(EXAMPLES) == 4
