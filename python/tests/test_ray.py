"""Many photos and rooms on Ray. `checks/ray_workers.py` kills workers of a cluster."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import Cli
from PIL import Image

import lightoctree

try:
    import pyarrow as pa
    import ray as _
    from pyarrow import fs
except ImportError:
    if "LIGHTOCTREE_REQUIRE_PROGRAMS" in os.environ or "CI" in os.environ:
        raise
    pytest.skip("Ray is not installed", allow_module_level=True)

from test_data import CONFIG

from lightoctree.ray import EXTENSIONS, Estimate

ENVMAP = {"at": (0, 0, -1), "size": (32, 16), "level": True}


@pytest.fixture(scope="module")
def photos(photo: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two photos of one name in two folders, one of them with EXIF, and a file that is no photo."""
    folder = tmp_path_factory.mktemp("photos")
    for room, angle in (("a", 0), ("b", 180)):
        (folder / room).mkdir()
        with Image.open(photo) as image:
            exif = image.getexif()
            exif[0x112] = 1
            image.resize((192, 144)).rotate(angle).convert("RGB").save(folder / room / "1.jpg", exif=exif)
    (folder / "b/broken.jpg").write_bytes(b"\xff\xd8\xff\xe0 no photo")
    (folder / "b/.hidden.jpg").touch()
    (folder / "notes.txt").touch()
    return folder


def paths(folder: Path) -> list[str]:
    return [str(folder / name) for name in ("a/1.jpg", "b/1.jpg", "b/broken.jpg")]


def read(photo: str) -> bytes:
    return Path(photo).read_bytes()


def files(folder: Path) -> list[str]:
    return sorted(file.relative_to(folder).as_posix() for file in folder.rglob("*") if file.is_file())


def test_results_are_those_of_the_command(photos: Path, cli: Cli, tmp_path: Path) -> None:
    arguments = ["--envmap-at", "0,0,-1", "--size", "32x16", "--level", "-o", "expected"]
    cli("batch", photos, *arguments, status=1)
    batches: list[Any] = [
        {"path": np.array(paths(photos))},
        {"path": np.array(paths(photos)), "bytes": np.array([read(photo) for photo in paths(photos)], object)},
        pa.table({"path": [f"file://{photo}" for photo in paths(photos)]}),
    ]
    for number, batch in enumerate(batches):
        output = tmp_path / str(number)
        rows = Estimate(str(output), root=str(photos), envmap=ENVMAP)(batch).to_pylist()
        assert [row["error"] is None for row in rows] == [True, True, False]
        assert "broken.jpg" in rows[2]["error"] and "/tmp/lightoctree-" not in rows[2]["error"], rows[2]
        assert rows[2]["scene"] is None and rows[1]["scene"] == str(output / "b/1.jpg.scene")
        assert rows[0]["warnings"] and "predicted" in rows[0]["warnings"][0]
        names = ["a/1.jpg.exr", "a/1.jpg.scene", "b/1.jpg.exr", "b/1.jpg.scene"]
        assert files(output) == [*names, "lightoctree.json"]
        for name in names:
            assert read(str(output / name)) == read(str(tmp_path / "expected" / name)), name
    assert read(str(tmp_path / "0/a/1.jpg.exr")) != read(str(tmp_path / "0/b/1.jpg.exr"))


def test_finished_results_are_kept(photos: Path, tmp_path: Path) -> None:
    batch = {"path": np.array(paths(photos)[:2])}
    estimate = Estimate(str(tmp_path), root=str(photos), hfov_deg=60)
    scene = Path(estimate(batch).to_pylist()[1]["scene"])
    contents = scene.read_bytes()
    # As after a crash of the machine.
    scene.write_bytes(b"")
    again = Estimate(str(tmp_path), root=str(photos), hfov_deg=60)(batch).to_pylist()
    assert [row["kept"] for row in again] == [True, False] and scene.read_bytes() == contents
    with pytest.raises(ValueError, match="results of other settings: options was {'hfov_deg': 60}"):
        Estimate(str(tmp_path), root=str(photos), hfov_deg=61)


def test_arrays_have_the_results_of_arrays(photos: Path, tmp_path: Path) -> None:
    image = np.asarray(Image.open(photos / "a/1.jpg"))
    batch = {"path": np.array(["rooms/1.jpg"]), "image": image[np.newaxis]}
    (row,) = Estimate(str(tmp_path))(batch).to_pylist()
    assert row["scene"] == str(tmp_path / "rooms/1.jpg.scene")
    assert Path(row["scene"]).read_bytes() == lightoctree.estimate(image).to_bytes()


def test_other_file_systems(photos: Path, tmp_path: Path) -> None:
    inside = fs.SubTreeFileSystem(str(tmp_path), fs.LocalFileSystem())
    batch = {"path": np.array(paths(photos)[:1])}
    (row,) = Estimate("scenes", root=str(photos), filesystem=inside)(batch).to_pylist()
    assert row["scene"] == "scenes/a/1.jpg.scene" and (tmp_path / row["scene"]).stat().st_size > 1000
    import fsspec

    memory = fsspec.filesystem("memory")
    (row,) = Estimate("bucket/scenes", root=str(photos), filesystem=memory)(batch).to_pylist()
    assert memory.cat_file("bucket/scenes/a/1.jpg.scene") == (tmp_path / "scenes/a/1.jpg.scene").read_bytes()
    assert Estimate("bucket/scenes", root=str(photos), filesystem=memory)(batch)["kept"].to_pylist() == [True]


def test_wrong_use_is_refused(photos: Path, tmp_path: Path) -> None:
    output = str(tmp_path / "scenes")
    with pytest.raises(TypeError, match="hfov"):
        Estimate(output, hfov=65)
    with pytest.raises(TypeError, match="position"):
        Estimate(output, envmap={"at": (0, 0, 0), "position": (0, 0, 0)})
    with pytest.raises(ValueError, match="no results"):
        Estimate(output, scenes=False)
    with pytest.raises(ValueError, match="single photos"):
        Estimate(output, depth="depth.png")
    assert not Path(output).exists()
    estimate = Estimate(output, root=str(photos / "a"))
    with pytest.raises(ValueError, match="include_paths"):
        estimate({"image": np.zeros((1, 4, 4, 3), np.uint8)})
    outside = np.array([str(photos / "b/1.jpg"), str(photos / "a/../b/1.jpg"), str(photos / "a/none.jpg")])
    rows = estimate({"path": outside}).to_pylist()
    assert "outside of the root" in rows[0]["error"] and "outside of the root" in rows[1]["error"]
    assert "none.jpg" in rows[2]["error"]
    # A result that cannot be written is not a failure of its photo.
    (tmp_path / "scenes/b").touch()
    with pytest.raises(OSError):
        Estimate(output, root=str(photos))({"path": np.array([str(photos / "b/1.jpg")])})


def test_extensions_are_those_of_the_command(cli: Cli, tmp_path: Path) -> None:
    (tmp_path / "photos").mkdir()
    for extension in [*EXTENSIONS, "npy", "npz", "txt", "scene", "json"]:
        (tmp_path / f"photos/1.{extension}").touch()
    cli("batch", "photos", "-o", "scenes", status=1)
    lines = (tmp_path / "scenes/report.jsonl").read_text().splitlines()
    assert {json.loads(line)["photo"] for line in lines} == {f"1.{extension}" for extension in EXTENSIONS}


CLUSTER = """
import json, sys, warnings
import ray, lightoctree.ray

ray.init(num_cpus=2, include_dashboard=False, log_to_driver=False, logging_level="ERROR")
ray.data.DataContext.get_current().enable_progress_bars = False
photos, output, config = sys.argv[1:]
results = lightoctree.ray.photos(photos).map_batches(
    lightoctree.ray.Estimate,
    fn_constructor_kwargs={"root": photos, "output": output},
    batch_size=1,
    num_cpus=1,
    compute=ray.data.ActorPoolStrategy(size=2),
)
rows = results.take_all()
rooms = []
for row in lightoctree.ray.rooms(2, seed=5, config=json.loads(config)).iter_rows():
    shapes = {name: list(value.shape) for name, value in row.items() if hasattr(value, "shape")}
    rooms.append({"id": row["id"], "room": int(row["room"]), "sum": float(row["radiance"].sum()), "shapes": shapes})
print(json.dumps({"rows": rows, "rooms": rooms}))
"""


def test_a_cluster_estimates_photos_and_generates_rooms(photos: Path, tmp_path: Path) -> None:
    arguments = [str(photos), str(tmp_path / "scenes"), json.dumps(CONFIG)]
    command = [sys.executable, "-W", "ignore", "-c", CLUSTER, *arguments]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=300)
    assert done.returncode == 0, done.stderr[-4000:]
    told = json.loads(done.stdout.splitlines()[-1])
    rows = sorted(told["rows"], key=lambda row: str(row["path"]))
    assert [row["path"] for row in rows] == paths(photos)
    assert [row["error"] is None for row in rows] == [True, True, False]
    for row in rows[:2]:
        assert Path(row["scene"]).read_bytes() == lightoctree.estimate(row["path"]).to_bytes()
    rooms = sorted(told["rooms"], key=lambda room: str(room["id"]))
    expected = lightoctree.data.rooms(2, seed=5, config=CONFIG)
    assert [room["id"] for room in rooms] == [sample["id"] for sample in expected]
    assert [room["room"] for room in rooms] == [0, 0, 1, 1]
    for room, sample in zip(rooms, expected, strict=True):
        assert room["sum"] == pytest.approx(float(sample["radiance"].sum()), rel=1e-6)
        assert room["shapes"]["photo"] == list(sample["photo"].shape)
        assert room["shapes"]["views_radiance"][0] == len(sample["views"])


def test_ray_is_not_imported_by_the_package() -> None:
    code = "import sys, lightoctree; print(*(name in sys.modules for name in ('ray', 'pyarrow')))"
    told = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert told == "False False\n"
