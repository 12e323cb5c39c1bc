"""`Scene.insert` against the command `insert`."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import ROOT, Cli
from PIL import Image

import lightoctree
from lightoctree import InsertError, LightOctreeWarning, Scene

SUZANNE = ROOT / "crates/lightoctree/models/suzanne.glb"


@pytest.mark.parametrize(
    ("objects", "options", "arguments"),
    [
        (
            {"mesh": "builtin:sphere", "pixel": np.array([270, 290])},
            {"quality": "draft"},
            ["--mesh", "builtin:sphere", "--pixel", "270,290", "--quality", "draft"],
        ),
        ({"mesh": "builtin:sphere", "pixel": (270, 290)}, {}, ["--mesh", "builtin:sphere", "--pixel", "270,290"]),
        (
            [
                {"mesh": "builtin:tea-set", "position_m": (0, -0.6, -1.5), "yaw_deg": 30, "align": "none"},
                {"mesh": SUZANNE, "pixel": (200, 310), "height_m": 0.2, "material": {"preset": "gold"}},
            ],
            {"light": "expected", "floor_gloss": 0.5, "match_look": False},
            [
                *("--mesh", "builtin:tea-set", "--at", "0,-0.6,-1.5", "--yaw-deg", 30, "--align", "none"),
                *("--mesh", SUZANNE, "--pixel", "200,310", "--height", 0.2, "--material", "gold"),
                *("--light", "expected", "--floor-gloss", 0.5, "--match-look", "off"),
            ],
        ),
    ],
    ids=["draft", "normal", "two"],
)
def test_composites_are_those_of_the_command_line(
    objects: Any, options: dict[str, Any], arguments: list[object], scene: Scene, scene_file: Path, cli: Cli, tmp_path: Path
) -> None:
    cli("insert", scene_file, *arguments, "-o", "cli.png", "--layers", "cli.exr")
    composite = scene.insert(objects, passes=True, **options)
    composite.save(tmp_path / "python.png")
    composite.save_layers(tmp_path / "python.exr")
    for name in ("png", "exr"):
        assert (tmp_path / f"python.{name}").read_bytes() == (tmp_path / f"cli.{name}").read_bytes()
    with Image.open(tmp_path / "cli.png") as image:
        assert np.array_equal(composite.image, np.asarray(image))
    layers = composite.layers
    assert ("reflection" in layers) == ("floor_gloss" in options)
    assert all(layer.dtype == np.float32 and layer.shape[:2] == (360, 480) for layer in layers.values())
    parts = ("diffuse", "specular", "transmission", "emission", "edge")
    assert np.abs(sum(layers[part] for part in parts) - layers["object"]).max() < 1e-5
    for mattes in (composite.object_mattes, composite.material_mattes):
        assert np.abs(sum(mattes.values()) - layers["alpha"]).max() < 1e-5
    # The layers give the image, in linear light.
    srgb = scene.photo / 255
    linear = np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4)
    below = linear * layers["shadow_ratio"] + layers.get("reflection", 0)
    linear = np.clip(below * (1 - layers["alpha"][..., None]) + layers["object"] + layers.get("grain", 0), 0, 1)
    srgb = np.where(linear <= 0.0031308, linear * 12.92, 1.055 * linear ** (1 / 2.4) - 0.055)
    # Half a code of rounding, and that of f32.
    assert np.abs(255 * srgb - composite.image).max() < 0.51


def test_layouts_are_files_and_relative_to_them(scene: Scene, scene_file: Path, cli: Cli, tmp_path: Path) -> None:
    folder = tmp_path / "objects"
    folder.mkdir()
    (folder / "head.glb").write_bytes(SUZANNE.read_bytes())
    layout = [{"mesh": "head.glb", "pixel": [240, 300], "height_m": 0.2}]
    (folder / "layout.json").write_text(json.dumps(layout))
    cli("insert", scene_file, "--layout", folder / "layout.json", "--quality", "draft", "-o", "cli.png")
    scene.insert(folder / "layout.json", quality="draft").save(tmp_path / "python.png")
    assert (tmp_path / "python.png").read_bytes() == (tmp_path / "cli.png").read_bytes()


def test_sequences_are_those_of_the_command_line(scene: Scene, scene_file: Path, cli: Cli, tmp_path: Path) -> None:
    keyframes = [{"time_s": 0, "pixel": [200, 300]}, {"time_s": 2, "pixel": [280, 310]}]
    (tmp_path / "path.json").write_text(json.dumps({"keyframes": keyframes}))
    arguments = ["--mesh", "builtin:sphere", "--path", "path.json", "--frames", 3, "--quality", "draft"]
    cli("insert", scene_file, *arguments, "-o", "cli_%d.png")
    for path in (tmp_path / "path.json", {"keyframes": keyframes}):
        ball = {"mesh": "builtin:sphere", "path": path}
        sequence = scene.sequence(ball, 3, quality="draft")
        assert len(sequence) == 3
        for index, composite in enumerate(sequence):
            composite.save(tmp_path / "python.png")
            assert (tmp_path / "python.png").read_bytes() == (tmp_path / f"cli_{index}.png").read_bytes()
        assert len(sequence) == 0 and next(sequence, None) is None
    with pytest.raises(ValueError, match="sphere moves: use sequence"):
        scene.insert(ball)
    with pytest.raises(ValueError, match="sphere moves: give the number of frames"):
        scene.sequence(ball)
    with pytest.raises(ValueError, match="frames must be from 1 to 100000, not 0"):
        scene.sequence(ball, 0)
    with pytest.raises(ValueError, match="no object moves"):
        scene.sequence({"mesh": "builtin:sphere", "pixel": (240, 300)}, 3)


def test_composites_show_themselves(scene: Scene, tmp_path: Path) -> None:
    composite = scene.insert({"mesh": "builtin:sphere", "pixel": (270, 290)}, quality="draft")
    (tmp_path / "shown.png").write_bytes(composite._repr_png_())
    with Image.open(tmp_path / "shown.png") as shown:
        assert np.array_equal(np.asarray(shown), composite.image)
    assert repr(composite) == "<lightoctree.Composite: 480 × 360 pixels>"


def test_previews_of_large_photos_are_reduced(depth: Path, tmp_path: Path) -> None:
    scene = lightoctree.estimate(np.full((1200, 1600, 3), 90, np.uint8), depth=depth, hfov_deg=60)
    (tmp_path / "shown.png").write_bytes(scene._repr_png_())
    with Image.open(tmp_path / "shown.png") as shown:
        assert shown.size == (1024, 768) and np.asarray(shown).min() == np.asarray(shown).max() == 90


@pytest.mark.parametrize(
    ("error", "words", "objects", "options"),
    [
        (ValueError, "the scene has no objects", None, {}),
        (InsertError, "needs 1 to 100 objects", [], {}),
        (InsertError, "needs exactly one of", {"mesh": "builtin:sphere"}, {}),
        (InsertError, "`pixl`", {"mesh": "builtin:sphere", "pixl": (1, 2)}, {}),
        (InsertError, "choose one of builtin:sphere", {"mesh": "builtin:cat", "pixel": (240, 300)}, {}),
        (InsertError, "outside the 480 × 360 photo", {"mesh": "builtin:sphere", "pixel": (999, 1)}, {}),
        (FileNotFoundError, "none.glb", {"mesh": "none.glb", "pixel": (240, 300)}, {}),
        (FileNotFoundError, "none.json", "none.json", {}),
        (TypeError, "objects must be dictionaries, not int", [3], {}),
        (TypeError, "object cannot be used in objects", {"mesh": object()}, {}),
        (ValueError, "quality must be", {"mesh": "builtin:sphere", "pixel": (1, 2)}, {"quality": "best"}),
        (ValueError, "floor_gloss must be from 0 to 1", {"mesh": "builtin:sphere", "pixel": (1, 2)}, {"floor_gloss": 2}),
    ],
)
def test_wrong_objects_are_refused(
    error: type[Exception], words: str, objects: Any, options: dict[str, Any], scene: Scene
) -> None:
    with pytest.raises(error) as refused:
        scene.insert(objects, **options)
    assert words in str(refused.value), str(refused.value)


def test_warnings_name_the_objects(scene: Scene) -> None:
    objects: list[dict[str, Any]] = [
        {"name": "vase", "mesh": "builtin:sphere", "pixel": (270, 290)},
        {"name": "tower", "mesh": "builtin:sphere", "pixel": (200, 310), "height_m": 40},
    ]
    with pytest.warns(LightOctreeWarning, match="tower") as warned:
        scene.insert(objects, quality="draft")
    assert all(warning.filename == __file__ for warning in warned)
