"""The Python code of documents runs as written, in the order of each page."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import numpy as np
import pytest
from conftest import ROOT
from PIL import Image

PAGES = ["docs/python.md", "README.md", "python/README.md"]


@pytest.mark.parametrize("page", PAGES)
@pytest.mark.filterwarnings("ignore::ResourceWarning")
def test_documented_code_runs(
    page: str, photo: Path, depth: Path, scene_file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    blocks = re.findall(r"^```python\n(.*?)^```", (ROOT / page).read_text(encoding="utf-8"), re.DOTALL | re.MULTILINE)
    blocks = [block for block in blocks if "lightoctree" in block or page == "docs/python.md"]
    blocks = [block for block in blocks if "safetensors" not in block]
    assert blocks
    # The pixels of the READMEs are those of the whole photo.
    size = (480, 360) if page == "docs/python.md" else (1920, 1440)
    with Image.open(photo) as small:
        small.resize(size).save(tmp_path / "photo.jpg")
    shutil.copy(depth, tmp_path / "depth.png")
    shutil.copy(scene_file, tmp_path / "room.scene")
    write_hdr(tmp_path / "theta.hdr")
    monkeypatch.chdir(tmp_path)
    names: dict[str, object] = {}
    for block in blocks:
        exec(compile(block, page, "exec"), names)


def write_hdr(file: Path) -> None:
    """Writes a panorama as uncompressed Radiance HDR."""
    rgbe = np.full((32, 64, 4), (40, 40, 40, 128), np.uint8)
    rgbe[3:6, 30:36] = (200, 180, 160, 133)
    file.write_bytes(b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 32 +X 64\n" + rgbe.tobytes())
