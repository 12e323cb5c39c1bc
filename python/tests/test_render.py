"""Cone tracing and its gradient, against closed forms and finite differences."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from lightoctree import LightOctreeWarning, Scene, SceneError
from lightoctree.render import Octree, panorama_rays, trace, trace_backward

CUBE = (-1.5, -1.5, -1.5, 3.0)


def sphere(count: int = 40_000) -> NDArray[np.float32]:
    """Points of the unit sphere."""
    vectors = np.random.default_rng(1).normal(size=(count, 3))
    unit: NDArray[np.float64] = vectors / np.linalg.norm(vectors, axis=1, keepdims=True)
    return unit.astype(np.float32)


def octree(radiance: Any = (0.5, 0.25, 0.125), depth: int = 5) -> Octree:
    points = sphere()
    return Octree.from_points(points, np.broadcast_to(radiance, points.shape), depth=depth, cube=CUBE)


def test_sphere_is_seen_from_its_centre() -> None:
    directions, tan_half_angle = panorama_rays(16)
    samples = trace(octree(), (0, 0, 0), directions, tan_half_angle=tan_half_angle)
    assert samples.shape == (16, 32, 5) and samples.dtype == np.float32
    assert samples[..., 4].min() > 0.99, "it is closed"
    assert samples[..., :3] == pytest.approx(np.broadcast_to((0.5, 0.25, 0.125), (16, 32, 3)), rel=0.01)
    # A leaf is 9 cm.
    assert np.abs(samples[..., 3] - 1).max() < 0.1


def test_directions_are_those_of_panoramas() -> None:
    points = sphere()
    half = octree(np.array([[1, 0, 0], [0, 0, 1]])[(points[:, 0] > 0).astype(int)])
    directions, tan_half_angle = panorama_rays(16)
    samples = trace(half, (0, 0, 0), directions, tan_half_angle=tan_half_angle)
    assert samples[8, 28, 2] > 0.9 and samples[8, 28, 0] < 0.1, "+X is right of the centre"
    assert samples[8, 4, 0] > 0.9
    up, _ = panorama_rays(16)
    assert up[0, :, 1].min() > 0.99 and up[8, 16] == pytest.approx((0, 0, -1), abs=0.2)


def test_environment_of_a_scene_is_near_its_octree(scene: Scene) -> None:
    directions, tan_half_angle = panorama_rays(32)
    at = (0.2, -0.4, -1.5)
    samples = trace(scene.octree, at, directions, tan_half_angle=tan_half_angle)
    panorama = scene.environment(at, (64, 32), light="even")
    difference = np.abs(np.log((samples[..., :3] + 0.05) / (panorama + 0.05)))
    # The environment is sharpened by the photo.
    assert np.median(difference) < 0.1


def test_gradient_is_that_of_finite_differences() -> None:
    light = octree(depth=4)
    rng = np.random.default_rng(3)
    rgba = rng.uniform(0.2, 0.8, light.rgba.shape).astype(np.float32)
    directions, _ = panorama_rays(12)
    cones: dict[str, Any] = {"octree": light, "origins": (0.11, -0.2, 0.07), "directions": directions}
    cones["tan_half_angle"] = 0.05
    weights = rng.normal(size=(12, 24, 5)).astype(np.float32)

    def loss(values: NDArray[np.float32]) -> float:
        return float((trace(**cones, rgba=values).astype(np.float64) * weights).sum())

    gradient = trace_backward(**cones, d_samples=weights, rgba=rgba)
    assert gradient.shape == rgba.shape
    rows = rng.choice(np.flatnonzero(np.abs(gradient).max(axis=1) > 0.05), 20, replace=False)
    for row in rows:
        for channel in range(4):
            step = np.zeros_like(rgba)
            step[row, channel] = 5e-3
            difference = (loss(rgba + step) - loss(rgba - step)) / 1e-2
            assert difference == pytest.approx(gradient[row, channel], rel=0.03, abs=0.02), (row, channel)


def test_descent_recovers_radiance() -> None:
    true, start = octree((0.6, 0.3, 0.9)), octree((0.2, 0.2, 0.2))
    directions, tan_half_angle = panorama_rays(24)
    cones: dict[str, Any] = {"origins": (0, 0, 0), "directions": directions, "tan_half_angle": tan_half_angle}
    target = trace(true, **cones)[..., :3]
    rgba = start.rgba
    losses = []
    for _ in range(150):
        samples = trace(start, rgba=rgba, **cones)
        error = samples[..., :3] - target
        losses.append(float((error**2).mean()))
        d_samples = np.zeros_like(samples)
        d_samples[..., :3] = error
        gradient = trace_backward(start, d_samples=d_samples, rgba=rgba, **cones)
        rgba[:, :3] -= 0.02 * gradient[:, :3]
    assert losses[-1] < 0.05 * losses[0]


def test_points_outside_are_left_out() -> None:
    with pytest.warns(LightOctreeWarning, match="1 points are outside of the cube, 2 are NaN or infinite"):
        points = np.array([[0, 0, 0], [9, 0, 0], [np.nan, 0, 0], [0, 0, 0.1]])
        Octree.from_points(points, np.array([[1, 1, 1]] * 3 + [[np.inf, 0, 0]]), cube=CUBE)
    found = Octree.from_points([[1.0, 2, 3], [2.0, 2, 3]], np.ones((2, 3)), depth=4)
    assert found.edge_m == pytest.approx(1.05) and found.origin_m == pytest.approx((0.975, 1.475, 2.475))


@pytest.mark.parametrize(
    ("words", "change"),
    [
        (r"directions has the shape \(2,\); expected \(..., 3\)", {"directions": [0, 1]}),
        ("directions contains a vector of length 0", {"directions": [[0, 0, 0]]}),
        ("origins contains NaN", {"origins": [0, np.nan, 0]}),
        ("tan_half_angle must not be negative", {"tan_half_angle": -0.1}),
        (r"rgba has 3 rows, the octree has \d+", {"rgba": np.zeros((3, 4))}),
        (r"rgba has the shape \[3, 3\]; expected \[N, 4\]", {"rgba": np.zeros((3, 3))}),
        ("shape mismatch", {"directions": np.ones((2, 3)), "tan_half_angle": [0.1, 0.1, 0.1]}),
    ],
)
def test_wrong_cones_are_refused(words: str, change: dict[str, Any]) -> None:
    with pytest.raises(ValueError, match=words):
        arguments: dict[str, Any] = {"octree": octree(depth=4), "origins": (0, 0, 0), "directions": [[0, 0, -1]]}
        trace(**arguments | change)


def test_wrong_points_are_refused() -> None:
    points = np.zeros((4, 3))
    with pytest.raises(ValueError, match="one radiance for each position"):
        Octree.from_points(points, np.zeros((3, 3)))
    with pytest.raises(ValueError, match="no finite position"):
        Octree.from_points(np.full((4, 3), np.nan), points)
    with pytest.raises(SceneError):
        Octree.from_points(points, points, depth=99)
    with pytest.raises(TypeError, match="numbers"):
        Octree.from_points(np.array(["a"]), points)
