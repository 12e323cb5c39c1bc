"""Samples for training and evaluation as dictionaries of NumPy arrays.

    for sample in lightoctree.data.rooms(100, seed=1):
        train(sample["photo"], sample["radiance"], sample["views"])
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, TypedDict

from lightoctree._lightoctree import Dataset, read, rooms
from lightoctree._types import Vector

if TYPE_CHECKING:
    # The command does not need it.
    import numpy as np
    from numpy.typing import NDArray

__all__ = ["Dataset", "Sample", "View", "read", "rooms"]


class View(TypedDict, total=False):
    """A panorama at a position."""

    position_m: Vector
    """Position in the photo's frame, in metres."""
    rotation_xyzw: tuple[float, float, float, float]
    """Quaternion from directions of the panorama to those of the photo."""
    radiance: NDArray[np.float32]
    """Equirectangular radiance [H, W, 3]."""
    depth_m: NDArray[np.float32]
    """Distance from the position in metres [H, W]."""


class Sample(TypedDict, total=False):
    """A photo with the data of its room. What a data set lacks is absent.

    Positions and directions are in the photo's frame, in metres. Radiance is linear; 1 is the photo's white.
    """

    id: str
    """Name, unique in the data set."""
    scene_id: str
    """Name of the room."""
    photo: NDArray[np.uint8]
    """sRGB photo [H, W, 3]."""
    intrinsics: tuple[float, float, float, float]
    """Focal lengths and principal point (fx, fy, cx, cy) in pixels."""
    up: Vector
    """Unit vector against gravity."""
    radiance: NDArray[np.float32]
    """Radiance of the photo's pixels [H, W, 3]."""
    depth_m: NDArray[np.float32]
    """True depth along the optical axis [H, W]."""
    sensor_depth_m: NDArray[np.float32]
    """Depth measured by a sensor [h, w]."""
    normal: NDArray[np.float32]
    """Unit normals in camera axes [H, W, 3]."""
    albedo: NDArray[np.float32]
    """Base colour [H, W, 3]."""
    points_m: NDArray[np.float32]
    """Points on all surfaces of the room [N, 3]."""
    points_radiance: NDArray[np.float32]
    """Radiance that leaves them [N, 3]."""
    points_observed: NDArray[np.bool_]
    """Whether the photo shows them [N]."""
    views: list[View]
    """Panoramas at positions in the room."""
    metadata: dict[str, Any]
    """Camera settings, description of the room, file names."""


def _rooms(count: int, seed: int, config: str) -> Dataset:
    import json

    return rooms(count, seed=seed, config=json.loads(config))


def _read(path: str, seed: int) -> Dataset:
    return read(path, seed=seed)
