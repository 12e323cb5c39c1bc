"""`estimate` against the command line, to the byte, and the forms in which inputs may be given."""

from __future__ import annotations

import json
import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import ROOT, Cli
from numpy.typing import NDArray
from PIL import Image

import lightoctree
from lightoctree import EstimateError, ImageError, LightOctreeError, LightOctreeWarning, Panorama, Scene

FIXTURES = ROOT / "crates/learn/lo_depth_models/tests/fixtures"
WEIGHTS = [ROOT / f"crates/learn/lo_weights_{part}/{part}.safetensors" for part in ("encoder", "heads")]


def assert_same(first: Scene, second: Scene) -> None:
    """Compares all but the names of the inputs."""
    assert np.array_equal(first.depth, second.depth)
    assert np.array_equal(first.photo, second.photo)
    assert first.intrinsics == second.intrinsics
    for one, other in zip(first.octree.levels, second.octree.levels, strict=True):
        assert np.array_equal(one.keys, other.keys) and np.array_equal(one.rgba, other.rgba)


def panorama_file(folder: Path) -> Path:
    """A panorama with a lamp overhead, as PFM."""
    radiance = np.full((32, 64, 3), 0.2, np.float32)
    radiance[3:6, 30:36] = 20
    file = folder / "theta.pfm"
    # Rows of a PFM go from the bottom to the top.
    file.write_bytes(b"PF\n64 32\n-1\n" + radiance[::-1].tobytes())
    return file


def weights_file(folder: Path) -> Path:
    """The shipped weights in one file."""
    tensors: dict[str, Any] = {}
    data = b""
    for part in WEIGHTS:
        content = part.read_bytes()
        (length,) = struct.unpack("<Q", content[:8])
        header = json.loads(content[8 : 8 + length])
        tensors.setdefault("__metadata__", {}).update(header.pop("__metadata__"))
        for name, tensor in header.items():
            tensor["data_offsets"] = [len(data) + offset for offset in tensor["data_offsets"]]
            tensors[name] = tensor
        data += content[8 + length :]
    header_bytes = json.dumps(tensors).encode()
    (folder / "own.safetensors").write_bytes(struct.pack("<Q", len(header_bytes)) + header_bytes + data)
    return folder / "own.safetensors"


def lens_file(folder: Path) -> Path:
    """A lens with distortion, in the format of NeRF programs."""
    lens = {"fl_x": 420.0, "fl_y": 420.0, "cx": 240.0, "cy": 180.0, "w": 480, "h": 360, "k1": -0.05}
    file = folder / "transforms.json"
    file.write_text(json.dumps(lens))
    return file


def inverse_file(folder: Path) -> Path:
    """Disparity of a room: near below, far above."""
    rows = np.linspace(0.2, 1.0, 90, dtype=np.float32)
    np.save(folder / "disparity.npy", np.repeat(rows[:, None], 120, axis=1))
    return folder / "disparity.npy"


Options = Callable[[Path, Path], tuple[dict[str, Any], list[object]]]


@pytest.mark.parametrize(
    "options",
    [
        pytest.param(lambda _folder, _depth: ({}, []), id="photo-alone"),
        pytest.param(
            lambda _folder, depth: (
                {"depth": depth, "intrinsics": (400, 401.5, 238, 181), "up": (0.1, 3, -0.2), "seed": 7},
                ["--depth", depth, "--intrinsics", "400,401.5,238,181", "--up", "0.1,3,-0.2", "--seed", 7],
            ),
            id="depth-intrinsics-up-seed",
        ),
        pytest.param(
            lambda _folder, depth: (
                {"depth": depth, "depth_is": "predicted", "hfov_deg": 63.5},
                ["--depth", depth, "--depth-is", "predicted", "--hfov-deg", 63.5],
            ),
            id="predicted-hfov",
        ),
        pytest.param(
            lambda folder, _depth: (
                {"depth": inverse_file(folder), "depth_is": "inverse"},
                ["--depth", inverse_file(folder), "--depth-is", "inverse"],
            ),
            id="inverse",
        ),
        pytest.param(
            lambda folder, _depth: (
                {
                    "panorama": Panorama(
                        panorama_file(folder), at=(0.4, 0.1, -1.5), orientation="openexr", yaw_deg=30, exposure_ev=-0.5
                    ),
                    "weights": weights_file(folder),
                },
                [
                    *("--panorama", panorama_file(folder), "--panorama-at", "0.4,0.1,-1.5"),
                    *("--panorama-orientation", "openexr", "--panorama-yaw-deg", 30, "--panorama-exposure-ev", -0.5),
                    *("--weights", weights_file(folder)),
                ],
            ),
            id="panorama-weights",
        ),
        pytest.param(
            lambda folder, depth: (
                {"depth": depth, "panorama": panorama_file(folder), "intrinsics": lens_file(folder)},
                ["--depth", depth, "--panorama", panorama_file(folder), "--intrinsics", lens_file(folder)],
            ),
            id="panorama-lens-file",
        ),
        pytest.param(
            lambda _folder, _depth: (
                {"depth_model": FIXTURES / "plane_depth_anything_metric.onnx", "hfov_deg": 50},
                ["--depth-model", FIXTURES / "plane_depth_anything_metric.onnx", "--hfov-deg", 50],
            ),
            id="depth-model",
        ),
    ],
)
def test_bytes_are_those_of_the_command_line(
    options: Options, photo: Path, depth: Path, cli: Cli, tmp_path: Path
) -> None:
    keywords, arguments = options(tmp_path, depth)
    cli("estimate", photo, *arguments, "-o", "cli.scene", "--quiet")
    scene = lightoctree.estimate(photo, **keywords)
    scene.save(tmp_path / "python.scene")
    expected = (tmp_path / "cli.scene").read_bytes()
    assert (tmp_path / "python.scene").read_bytes() == expected
    assert scene.to_bytes() == expected


class Foreign:
    """A tensor of another library."""

    def __init__(self, array: NDArray[Any]) -> None:
        self.array = array

    def __dlpack__(self, *args: Any, **kwargs: Any) -> Any:
        return self.array.__dlpack__(*args, **kwargs)

    def __dlpack_device__(self) -> tuple[Any, int]:
        return self.array.__dlpack_device__()


def test_arrays_and_images_are_like_files(photo: Path, depth: Path) -> None:
    with Image.open(photo) as image, Image.open(depth) as map_mm:
        pixels = np.asarray(image)
        depth_m = np.asarray(map_mm).astype(np.float32) / 1000
        expected = lightoctree.estimate(photo, depth=depth)
        assert_same(lightoctree.estimate(image, depth=Foreign(depth_m)), expected)
    camera = expected.intrinsics
    matrix: list[list[float]] = [[camera[0], 0, camera[2]], [0, camera[1], camera[3]], [0, 0, 1]]
    # Without EXIF. Any memory layout, type of float and mark of missing readings is accepted.
    depth_m[depth_m == 0] = np.nan
    flipped = np.asfortranarray(pixels)[:, ::-1].copy()[:, ::-1]
    assert_same(lightoctree.estimate(flipped, depth=depth_m.astype(np.float64), intrinsics=matrix), expected)
    linear = lightoctree.estimate(pixels.astype(np.float64) / 255, depth=depth_m, intrinsics=matrix)
    assert linear.photo.dtype == np.float32 and np.array_equal(linear.photo, (pixels / 255).astype(np.float32))


def test_integers_of_16_bits_are_srgb(photo: Path, depth: Path, tmp_path: Path) -> None:
    with Image.open(photo) as image:
        wide = np.asarray(image).astype(np.uint16) * 257
    # A binary PPM of 16 bits is big-endian.
    (tmp_path / "photo.ppm").write_bytes(b"P6\n480 360\n65535\n" + wide.astype(">u2").tobytes())
    options: dict[str, Any] = {"depth": depth, "hfov_deg": 60}
    expected = lightoctree.estimate(tmp_path / "photo.ppm", **options)
    assert_same(lightoctree.estimate(wide.astype(">u2"), **options), expected)


def test_colour_profiles_and_modes_of_images_are_used(photo: Path, depth: Path, tmp_path: Path) -> None:
    with Image.open(photo) as image:
        grey = image.convert("L")
        grey.save(tmp_path / "grey.png")
        assert_same(
            lightoctree.estimate(grey, depth=depth, hfov_deg=60),
            lightoctree.estimate(tmp_path / "grey.png", depth=depth, hfov_deg=60),
        )
        assert lightoctree.estimate(image.convert("CMYK"), depth=depth, hfov_deg=60).photo.shape == (360, 480, 3)


def test_arrays_of_panoramas_are_like_files(depth: Path, tmp_path: Path) -> None:
    photo = np.full((48, 64, 3), 120, np.uint8)
    photo[:, 32:] = 60
    radiance = np.frombuffer(panorama_file(tmp_path).read_bytes()[12:], np.float32).reshape(32, 64, 3)[::-1]
    assert_same(
        lightoctree.estimate(photo, depth=depth, panorama=radiance),
        lightoctree.estimate(photo, depth=depth, panorama=tmp_path / "theta.pfm"),
    )
    clipped = (255 * np.minimum(radiance, 1)).astype(np.uint8)
    Image.fromarray(clipped).save(tmp_path / "theta.png")
    expected = lightoctree.estimate(photo, depth=depth, panorama=tmp_path / "theta.png")
    assert_same(lightoctree.estimate(photo, depth=depth, panorama=clipped), expected)
    assert repr(Panorama(radiance)) == "<lightoctree.Panorama \"panorama\": 64 × 32 pixels at (0, 0, 0)>"


PIXELS = np.zeros((48, 64, 3), np.uint8)


@pytest.mark.parametrize(
    ("error", "words", "photo", "options"),
    [
        (FileNotFoundError, "No such file or directory: 'none.jpg'", "none.jpg", {}),
        (FileNotFoundError, "none.png", PIXELS, {"depth": "none.png"}),
        (FileNotFoundError, "none.onnx", PIXELS, {"depth_model": Path("none.onnx")}),
        (FileNotFoundError, "none.safetensors", PIXELS, {"weights": "none.safetensors"}),
        (FileNotFoundError, "none.json", PIXELS, {"intrinsics": "none.json"}),
        (FileNotFoundError, "none.hdr", PIXELS, {"panorama": "none.hdr"}),
        (IsADirectoryError, "", "/", {}),
        (TypeError, "photo must be a path or an array, not NoneType", None, {}),
        (TypeError, "photo is an array of int64; expected uint8 or uint16", np.zeros((4, 4, 3), np.int64), {}),
        (ValueError, "photo has the shape (4, 4)", np.zeros((4, 4)), {}),
        (ValueError, "photo.transpose(1, 2, 0)", np.zeros((3, 4, 4)), {}),
        (ValueError, "photo[..., :3]", np.zeros((4, 4, 4)), {}),
        (ValueError, "photo has the shape (0, 0, 3) and no pixels", np.zeros((0, 0, 3)), {}),
        (ValueError, "depth has the shape (0, 4) and no pixels", PIXELS, {"depth": np.zeros((0, 4))}),
        (TypeError, "depth is an array of uint16; convert it to metres", PIXELS, {"depth": np.ones((4, 4), np.uint16)}),
        (ValueError, "depth.squeeze()", PIXELS, {"depth": np.ones((1, 4, 4))}),
        (ValueError, "depth: all depths are negative", PIXELS, {"depth": -np.ones((48, 64))}),
        (EstimateError, "", PIXELS, {"depth": np.ones((4, 4))}),
        (EstimateError, "", PIXELS, {"depth": np.full((48, 64), np.nan)}),
        (ValueError, "depth_is must be", PIXELS, {"depth": np.ones((48, 64)), "depth_is": "guessed"}),
        (ValueError, "depth is not given", PIXELS, {"depth_is": "predicted"}),
        (ValueError, "depth or depth_model", PIXELS, {"depth": np.ones((48, 64)), "depth_model": __file__}),
        (EstimateError, "", PIXELS, {"depth_model": __file__}),
        (EstimateError, "", PIXELS, {"weights": __file__}),
        (ValueError, "intrinsics or hfov_deg", PIXELS, {"intrinsics": (1, 1, 1, 1), "hfov_deg": 50}),
        (ValueError, "intrinsics has the shape (3,)", PIXELS, {"intrinsics": (1, 1, 1)}),
        (ValueError, "camera matrix without skew", PIXELS, {"intrinsics": np.ones((3, 3))}),
        (ValueError, "intrinsics: ", PIXELS, {"intrinsics": (-1, 1, 1, 1)}),
        (ValueError, "hfov_deg: ", PIXELS, {"hfov_deg": 200}),
        (ValueError, "up: a direction must not be zero", PIXELS, {"up": (0, 0, 0)}),
        (ValueError, "up: ", PIXELS, {"up": (np.nan, 0, 0)}),
        (ImageError, "twice as wide", PIXELS, {"panorama": np.ones((32, 32, 3))}),
        (ImageError, "", PIXELS, {"panorama": np.zeros((32, 64, 3))}),
        (OverflowError, "", PIXELS, {"seed": -1}),
    ],
)
def test_unusable_inputs_are_refused(error: type[Exception], words: str, photo: Any, options: dict[str, Any]) -> None:
    with pytest.raises(error) as refused:
        lightoctree.estimate(photo, **options)
    assert words in str(refused.value), str(refused.value)
    assert not str(refused.value).startswith("internal error")


def test_errors_of_the_library_have_one_base() -> None:
    assert issubclass(EstimateError, LightOctreeError) and issubclass(EstimateError, ValueError)
    with pytest.raises(LightOctreeError, match="test_estimate.py"):
        lightoctree.estimate(__file__)


def test_assumptions_are_warnings(photo: Path) -> None:
    with pytest.warns(LightOctreeWarning, match="depth is predicted from the photo alone") as warned:
        lightoctree.estimate(photo)
    assert {warning.filename for warning in warned} == {__file__}
