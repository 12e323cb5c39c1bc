"""Generated rooms and data sets as dictionaries of arrays."""

from __future__ import annotations

import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from lightoctree import DatasetError, data

# Coarse, so that a room takes a moment.
CONFIG: dict[str, Any] = {
    "shots": 2,
    "panoramas": 2,
    "panorama_height": 8,
    "octree_depth": 4,
    "light": {"spacing_m": 1.0, "gather_rays": 4, "light_rays": 4, "pixel_rays": 1},
}


def test_rooms_have_photos_with_their_light() -> None:
    rooms = data.rooms(3, seed=5, config=CONFIG)
    assert len(rooms) == 6 and repr(rooms) == "<lightoctree.data.Dataset: 6 samples>"
    sample = rooms[0]
    height, width, _ = sample["photo"].shape
    assert sample["photo"].dtype == np.uint8 and sample["photo"].std() > 1
    for name in ("radiance", "normal", "albedo"):
        assert sample[name].shape == (height, width, 3) and sample[name].dtype == np.float32
    assert sample["depth_m"].shape == (height, width) and 0.2 < np.median(sample["depth_m"]) < 10
    assert np.allclose(np.linalg.norm(sample["normal"][sample["depth_m"] > 0], axis=-1), 1, atol=1e-3)
    assert abs(np.linalg.norm(sample["up"]) - 1) < 1e-5
    points = sample["points_m"]
    assert points.shape == sample["points_radiance"].shape and sample["points_observed"].shape == points.shape[:1]
    assert 0 < sample["points_observed"].sum() < len(points)
    views = [view for shot in (rooms[0], rooms[1]) for view in shot["views"]]
    assert len(views) == 2 and views[0]["radiance"].shape == (8, 16, 3)
    assert "room" in sample["metadata"]
    # Two photos of one room.
    assert rooms[1]["scene_id"] == sample["scene_id"] == "synth-5-000000" and rooms[1]["id"] != sample["id"]
    assert rooms[2]["scene_id"] == "synth-5-000001" and rooms[-1]["scene_id"] == "synth-5-000002"
    assert rooms.split(0) == rooms.split(1)


def test_rooms_are_the_same_again_and_after_a_pickle() -> None:
    first = data.rooms(1, seed=2, config=CONFIG)
    for again in (data.rooms(1, seed=2, config=CONFIG), pickle.loads(pickle.dumps(first))):
        assert [sample["id"] for sample in again] == [sample["id"] for sample in first]
        assert np.array_equal(again[1]["photo"], first[1]["photo"])
    assert not np.array_equal(data.rooms(1, seed=3, config=CONFIG)[0]["photo"], first[0]["photo"])


def test_data_sets_are_read(tmp_path: Path) -> None:
    panorama = np.zeros((64, 128, 3), np.float32)
    panorama[:32] = 1
    panorama[32:] = 0.25
    (tmp_path / "room.pfm").write_bytes(b"PF\n128 64\n-1\n" + panorama[::-1].tobytes())
    photos = data.read(tmp_path)
    assert len(photos) > 0 and pickle.loads(pickle.dumps(photos))[0]["id"] == photos[0]["id"]
    assert photos[0]["photo"].shape[2] == 3 and "depth_m" not in photos[0]


def test_wrong_data_is_refused(tmp_path: Path) -> None:
    rooms = data.rooms(1, config=CONFIG)
    for index in (2, -3):
        with pytest.raises(IndexError, match=f"index {index} is out of range for 2 samples"):
            rooms[index]
    with pytest.raises(ValueError, match="config: .*`shoots`"):
        data.rooms(1, config={"shoots": 1})
    with pytest.raises(ValueError, match="config: shots is 0; it must be between 1 and 64"):
        data.rooms(1, config={"shots": 0})
    with pytest.raises(DatasetError, match="unknown dataset layout"):
        data.read(tmp_path)
    with pytest.raises(FileNotFoundError):
        data.read(tmp_path / "none")
    Image.new("RGB", (4, 4)).save(tmp_path / "room.tar", "PNG")
    with pytest.raises(DatasetError, match="room.tar"):
        data.read(tmp_path)[0]
