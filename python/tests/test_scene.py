"""Panoramas, lights and the octree of a scene, against the command line and the scene file."""

from __future__ import annotations

import copy
import json
import pickle
import struct
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pytest
from conftest import Cli
from numpy.typing import NDArray
from PIL import Image

import lightoctree
from lightoctree import LightsError, LightOctreeWarning, Scene, SceneError

AT = (0.2, -0.4, -1.5)
AT_TEXT = "0.2,-0.4,-1.5"


def pfm(file: Path) -> NDArray[np.float32]:
    kind, size, scale, data = file.read_bytes().split(b"\n", 3)
    width, height = map(int, size.split())
    assert (kind, float(scale) < 0) == (b"PF", True)
    return np.frombuffer(data, "<f4").reshape(height, width, 3)[::-1]


@pytest.mark.parametrize(
    ("options", "arguments"),
    [
        ({}, []),
        ({"size": (128, 64), "level": True}, ["--size", "128x64", "--level"]),
        ({"light": "plausible"}, ["--light", "plausible"]),
        ({"light": "even", "level": True}, ["--light", "even", "--level"]),
    ],
)
def test_panoramas_are_those_of_envmap(
    options: dict[str, Any], arguments: list[object], scene: Scene, scene_file: Path, cli: Cli, tmp_path: Path
) -> None:
    files = ["--sh9", "sh9.json", "--main-light", "main.json", "-o", "light.pfm"]
    cli("envmap", scene_file, "--at", AT_TEXT, *arguments, *files)
    panorama = scene.environment(AT, **options)
    assert panorama.dtype == np.float32 and panorama.flags.writeable
    assert np.array_equal(panorama, pfm(tmp_path / "light.pfm"))
    assert np.array_equal(scene.environment(np.array(AT), **options), panorama), "repeated, from an array"
    options.pop("size", None)
    if "--size" in arguments:
        return
    sh9 = json.loads((tmp_path / "sh9.json").read_text())["sh9"]["coefficients"]
    assert np.array_equal(scene.sh9(AT, **options), np.float32(sh9))
    expected = json.loads((tmp_path / "main.json").read_text())["main_light"]
    light = scene.main_light(AT, **options)
    assert (light is None) == (expected is None)
    if light is not None:
        assert light.direction == tuple(expected["direction"]) and light.share == expected["share"]


def test_unusual_positions_are_warned_of(scene: Scene) -> None:
    with pytest.warns(LightOctreeWarning, match=r"\(0, 0, 50\) is outside of the octree's cube") as warned:
        scene.environment((0, 0, 50), (8, 4))
    assert warned[0].filename == __file__


@pytest.mark.parametrize(
    ("words", "arguments", "options"),
    [
        ("the width of a panorama must be twice its height", [AT, (256, 512)], {}),
        ("at most 16384", [AT, (32768, 16384)], {}),
        ("at: coordinates must be from", [(0, 0, 1e9)], {}),
        ("at: ", [(0, np.nan, 0)], {}),
        ('light must be "even" or "expected" or "plausible", not "sunny"', [AT], {"light": "sunny"}),
    ],
)
def test_wrong_options_are_refused(words: str, arguments: list[Any], options: dict[str, Any], scene: Scene) -> None:
    with pytest.raises(ValueError) as refused:
        scene.environment(*arguments, **options)
    assert words in str(refused.value)


def test_a_scene_without_up_is_not_levelled(tmp_path: Path, photo: Path, depth: Path, cli: Cli) -> None:
    cli("estimate", photo, "--depth", depth, "--completion", "none", "-o", "open.scene")
    scene = Scene.load(tmp_path / "open.scene")
    assert scene.up is None
    with pytest.raises(ValueError, match="level: the scene has no up direction"):
        scene.environment(AT, level=True)


def test_scenes_survive_files_and_pickles(scene: Scene, scene_file: Path, tmp_path: Path) -> None:
    expected = scene_file.read_bytes()
    assert Scene.from_bytes(expected).to_bytes() == expected
    assert pickle.loads(pickle.dumps(scene)).to_bytes() == expected
    assert copy.deepcopy(scene).to_bytes() == expected
    copied = copy.copy(scene)
    copied.set_light(copied.lights[0].id, on=False)
    assert copied.to_bytes() != expected and scene.to_bytes() == expected
    scene.save(str(tmp_path / "again.scene"))
    assert (tmp_path / "again.scene").read_bytes() == expected
    with pytest.raises(FileNotFoundError, match="none.scene"):
        Scene.load("none.scene")
    with pytest.raises(FileNotFoundError):
        scene.save(tmp_path / "none" / "room.scene")
    (tmp_path / "cut.scene").write_bytes(expected[: len(expected) // 2])
    with pytest.raises(SceneError, match="cut.scene"):
        Scene.load(tmp_path / "cut.scene")
    with pytest.raises(SceneError):
        Scene.from_bytes(b"")


def test_lights_are_those_of_the_command_line(scene: Scene, scene_file: Path, cli: Cli, tmp_path: Path) -> None:
    def listed(file: Path) -> list[dict[str, Any]]:
        lights: list[dict[str, Any]] = json.loads(cli("lights", file, "--json").stdout)["lights"]
        return lights

    expected = listed(scene_file)
    assert expected and [light.id for light in scene.lights] == [light["id"] for light in expected]
    first = scene.lights[0]
    assert first.radiance == tuple(expected[0]["radiance"]) and first.position_m == tuple(expected[0]["position_m"])
    assert first.origin in ("observed", "inferred") and first.change is None
    before = scene.environment(AT, (64, 32))
    # An edit, its file and its effect.
    scene.set_light(first.id, scale=2.5, color=3000)
    cli("lights", "set", scene_file, first.id, "--scale", 2.5, "--color", "3000K", "-o", "edited.scene")
    assert scene.to_bytes() == (tmp_path / "edited.scene").read_bytes()
    assert scene.lights[0].change == lightoctree.LightChange(scale=2.5, color=3000)
    cli("envmap", "edited.scene", "--at", AT_TEXT, "--size", "64x32", "-o", "edited.pfm")
    edited = scene.environment(AT, (64, 32))
    assert np.array_equal(edited, pfm(tmp_path / "edited.pfm")) and not np.array_equal(edited, before)
    scene.set_light(first.id, on=False, color=(1, 0.5, 0.25), at=(0, 1, -1))
    change = scene.lights[0].change
    assert change == lightoctree.LightChange(on=False, scale=2.5, color=(1, 0.5, 0.25), at_m=(0, 1, -1))
    scene.reset_lights(first.id)
    assert scene.to_bytes() == scene_file.read_bytes()
    scene.set_light(first.id, on=False)
    scene.reset_lights()
    assert np.array_equal(scene.environment(AT, (64, 32)), before)


def test_wrong_edits_of_lights_are_refused(scene: Scene, scene_file: Path) -> None:
    id = scene.lights[0].id
    with pytest.raises(LightsError, match="L999"):
        scene.set_light("L999", on=False)
    with pytest.raises(LightsError, match="L999"):
        scene.reset_lights("L999")
    with pytest.raises(ValueError, match="the scale is out of range"):
        scene.set_light(id, scale=-1)
    with pytest.raises(ValueError, match="the colour is out of range"):
        scene.set_light(id, color=10)
    with pytest.raises(TypeError, match="color must be a temperature in kelvin or"):
        scene.set_light(id, color="red")  # type: ignore[arg-type]
    assert scene.to_bytes() == scene_file.read_bytes()


@pytest.mark.parametrize(
    ("kind", "at", "options", "arguments"),
    [
        (
            "sun",
            (),
            {"azimuth_deg": -60, "elevation_deg": 35, "strength": 8, "color": 5500},
            ["--azimuth=-60", "--elevation=35", "--strength=8", "--color=5500K"],
        ),
        ("sun", (), {"shadow": (60, 20, 75, 90), "strength": 4}, ["--shadow=60,20,75,90", "--strength=4"]),
        (
            "area",
            ((0.5, 0.25, -2),),
            {"size": (1.2, 0.3), "direction": (0, -1, 0.5), "two_sided": True, "radiance": 20},
            ["--size=1.2,0.3", "--direction=0,-1,0.5", "--two-sided", "--radiance=20"],
        ),
        (
            "area",
            ((0.5, 0.25, -2),),
            {"radius": 0.1, "power": 30, "color": (1, 0.5, 0.2)},
            ["--radius=0.1", "--power=30", "--color=1,0.5,0.2"],
        ),
    ],
)
def test_added_lights_are_those_of_the_command_line(
    kind: str,
    at: tuple[Any, ...],
    options: dict[str, Any],
    arguments: list[object],
    scene: Scene,
    scene_file: Path,
    cli: Cli,
    tmp_path: Path,
) -> None:
    place = ["--at=0.5,0.25,-2"] if at else []
    cli("lights", "add", kind, scene_file, *place, *arguments, "-o", "added.scene")
    before = scene.environment(AT, (64, 32))
    add = scene.add_sun if kind == "sun" else scene.add_area_light
    assert add(*at, **options) == "A1"
    assert scene.to_bytes() == (tmp_path / "added.scene").read_bytes()
    assert [light.origin for light in scene.lights if light.id == "A1"] == ["added"]
    assert not np.array_equal(scene.environment(AT, (64, 32)), before)
    scene.remove_light("A1")
    assert scene.to_bytes() == scene_file.read_bytes()


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({}, "give azimuth_deg and elevation_deg, or shadow"),
        ({"azimuth_deg": 3}, "give azimuth_deg and elevation_deg, or shadow"),
        ({"azimuth_deg": 3, "elevation_deg": 95, "strength": 1}, "elevation_deg: must be a number of degrees from -90"),
        ({"azimuth_deg": 3, "elevation_deg": 45, "strength": 0}, "strength: must be above 0"),
        ({"azimuth_deg": 3, "elevation_deg": -80}, "own sun is above the horizon, .*; with strength it may"),
        ({"shadow": (1e4, 0, 5, 5), "strength": 1}, "shadow: 10000,0 is outside the photo"),
    ],
)
def test_wrong_suns_are_refused(options: dict[str, Any], message: str, scene: Scene, scene_file: Path) -> None:
    with pytest.raises(ValueError, match=message):
        scene.add_sun(**options)
    assert scene.to_bytes() == scene_file.read_bytes()


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"radiance": 1}, "give size and direction, or radius"),
        ({"size": (1, 1), "radiance": 1}, "give size and direction, or radius"),
        ({"radius": 0.1}, "give radiance or power"),
        ({"radius": 0.1, "power": 1, "two_sided": True}, "two_sided has no effect on spheres"),
        ({"radius": 1e6, "power": 1}, "out of range"),
    ],
)
def test_wrong_area_lights_are_refused(options: dict[str, Any], message: str, scene: Scene) -> None:
    with pytest.raises(ValueError, match=message):
        scene.add_area_light(AT, **options)
    with pytest.raises(ValueError, match="L1 is part of the estimate and cannot be removed"):
        scene.remove_light("L1")
    with pytest.raises(LightsError, match="A7"):
        scene.remove_light("A7")


def tensors(file: Path) -> dict[str, NDArray[Any]]:
    """Reads the safetensors format."""
    data = file.read_bytes()
    (length,) = struct.unpack("<Q", data[:8])
    header = json.loads(data[8 : 8 + length])
    header.pop("__metadata__")
    types = {"U8": "u1", "I8": "i1", "BOOL": "?", "U16": "<u2", "U32": "<u4", "I32": "<i4", "F16": "<f2", "F32": "<f4"}
    data = data[8 + length :]

    def tensor(entry: dict[str, Any]) -> NDArray[Any]:
        begin, end = entry["data_offsets"]
        return np.frombuffer(data[begin:end], types[entry["dtype"]]).reshape(entry["shape"])

    return {name: tensor(entry) for name, entry in header.items() if entry["dtype"] in types}


def test_the_octree_is_that_of_the_file(scene: Scene, scene_file: Path) -> None:
    octree, stored = scene.octree, tensors(scene_file)
    assert len(octree.levels) == octree.depth + 1
    for depth, level in enumerate(octree.levels):
        for part in ("keys", "children", "rgba", "seen"):
            assert np.array_equal(getattr(level, part), stored[f"octree.{depth}.{part}"]), (depth, part)
        assert np.array_equal(level.rows >= 0, stored[f"octree.{depth}.nonempty"])
        lobes = stored.get(f"octree.{depth}.lobes")
        assert (level.lobes is None) == (lobes is None)
        assert lobes is None or level.lobes is None or np.array_equal(level.lobes, lobes)
    centres, edges, rgba = octree.leaves()
    # The command line reports the number of leaves in `inspect`, too.
    assert len(centres) == len(edges) == len(rgba) and centres.shape[1:] == (3,) and rgba.shape[1:] == (4,)
    low = np.array(octree.origin_m)
    assert (centres > low).all() and (centres < low + octree.edge_m).all()
    finest = octree.levels[-1]
    x, y, z = (sum((((finest.keys >> (3 * bit + axis)) & 1) << bit) for bit in range(octree.depth)) for axis in (2, 1, 0))
    edge = octree.edge_m / 2**octree.depth
    middles = (np.stack([x, y, z], axis=1) + 0.5) * edge + low
    assert np.allclose(centres[edges < 1.5 * edge], middles[finest.rows >= 0], atol=1e-4)


def test_arrays_share_memory_and_outlive_the_scene(scene: Scene) -> None:
    octree = scene.octree
    first, second = octree.levels[-1].rgba, octree.levels[-1].rgba
    assert first.__array_interface__["data"] == second.__array_interface__["data"]
    photo, depth = scene.photo, scene.depth
    assert photo.__array_interface__["data"] == scene.photo.__array_interface__["data"]
    for array in (first, photo, depth):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 0
        with pytest.raises(ValueError):
            array.flags.writeable = True
    expected = first.sum()
    del scene, octree, second
    assert first.sum() == expected and photo.any() and depth.any()


def test_a_pixel_has_its_surface(scene: Scene, scene_file: Path, cli: Cli) -> None:
    position, normal = scene.surface_at_pixel((240, 300))
    assert abs(np.linalg.norm(normal) - 1) < 1e-5
    place = ["--pixel", "240,300", "--lift", "0.1"]
    lifted = json.loads(cli("envmap", scene_file, *place, "-o", "at.pfm", "--json").stdout)["position_m"]
    assert np.allclose(np.add(position, np.multiply(0.1, normal)), lifted, atol=1e-6)
    with pytest.raises(lightoctree.InsertError, match="outside the 480 × 360 photo"):
        scene.surface_at_pixel((480, 0))


def test_scenes_show_themselves(scene: Scene, tmp_path: Path) -> None:
    (tmp_path / "scene.png").write_bytes(scene._repr_png_())
    with Image.open(tmp_path / "scene.png") as shown:
        assert np.array_equal(np.asarray(shown), scene.photo)
    assert repr(scene).startswith("<lightoctree.Scene: photo of 480 × 360 pixels, octree of depth 7 with ")
    assert repr(scene.octree).startswith("<lightoctree.Octree: depth 7, ")


@pytest.mark.parametrize(
    ("name", "options", "arguments"),
    [
        ("room.glb", {}, ["--to", "glb"]),
        ("room.ply", {"light": "even"}, ["--to", "ply", "--light", "even"]),
        ("room.usdz", {}, ["--to", "usdz"]),
        ("room.usda", {"level": True, "probes": [AT]}, ["--to", "usda", "--level", "--probe-at", AT_TEXT]),
    ],
)
def test_exports_are_those_of_the_command(
    name: str, options: dict[str, Any], arguments: list[object], scene: Scene, scene_file: Path, cli: Cli, tmp_path: Path
) -> None:
    (tmp_path / "own").mkdir()
    cli("export", scene_file, *arguments, "-o", name)
    files = scene.export(tmp_path / "own" / name, **options)
    assert files[0] == tmp_path / "own" / name
    expected = sorted(file for file in tmp_path.iterdir() if file.is_file())
    assert sorted(file.name for file in files) == [file.name for file in expected]
    for file in expected:
        assert (tmp_path / "own" / file.name).read_bytes() == file.read_bytes(), file.name


def test_web_pages_are_those_of_the_command(scene: Scene, scene_file: Path, cli: Cli, tmp_path: Path) -> None:
    cli("export", scene_file, "--to", "web", "--light", "expected", "-o", "page")
    files = scene.export_web(tmp_path / "own", title=scene_file.stem, light="expected")
    assert [file.name for file in files] == ["index.html", "page.js", "room.js", "three-LICENSE.txt"]
    for file in files:
        assert file.read_bytes() == (tmp_path / "page" / file.name).read_bytes(), file.name


@pytest.mark.parametrize("layout", ["webxr", "arkit", "unity"])
def test_light_estimates_are_those_of_the_command(
    layout: Literal["webxr", "arkit", "unity"], scene: Scene, scene_file: Path, cli: Cli, tmp_path: Path
) -> None:
    cli("envmap", scene_file, "--at", AT_TEXT, "--level", "--light-estimate", f"{layout}:light.json", "-o", "light.exr")
    expected = json.loads((tmp_path / "light.json").read_text())
    assert expected.pop("generator").startswith("lightoctree envmap")
    assert scene.light_estimate(AT, layout, level=True) == expected


def test_unknown_layouts_of_light_are_refused(scene: Scene) -> None:
    with pytest.raises(ValueError, match='layout must be "webxr" or "arkit" or "unity", not "arcore"'):
        scene.light_estimate(AT, "arcore")  # type: ignore[arg-type]


def test_exports_to_unknown_formats_are_refused(scene: Scene, tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"room.fbx: the extension must be one of .ply, .glb, .usda, .usd, .usdz"):
        scene.export(tmp_path / "room.fbx")
    with pytest.raises(FileNotFoundError):
        scene.export(tmp_path / "missing" / "room.glb")
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("name", "options", "arguments"),
    [
        ("light.exr", {"level": True, "orientation": "blender"}, ["--level", "--orientation", "blender"]),
        ("half.exr", {"half": True}, ["--half"]),
        ("light.hdr", {"light": "even"}, ["--light", "even"]),
    ],
)
def test_saved_environments_are_those_of_the_command(
    name: str,
    options: dict[str, Any],
    arguments: list[object],
    scene: Scene,
    scene_file: Path,
    cli: Cli,
    tmp_path: Path,
) -> None:
    cli("envmap", scene_file, "--at", AT_TEXT, "--size", "64x32", *arguments, "-o", name)
    scene.save_environment(tmp_path / f"own-{name}", AT, (64, 32), **options)
    assert (tmp_path / f"own-{name}").read_bytes() == (tmp_path / name).read_bytes()


def test_environments_that_cannot_be_saved_are_refused(scene: Scene, tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError):
        scene.save_environment(tmp_path / "missing" / "light.exr", AT, (64, 32))
    with pytest.raises(ValueError, match=r"light.gif"):
        scene.save_environment(tmp_path / "light.gif", AT, (64, 32))
    assert not list(tmp_path.iterdir())
