"""Cone tracing of an octree of radiance, and its exact gradient (docs/method.md, section 3).

    directions, tan_half_angle = lightoctree.render.panorama_rays(64)
    samples = lightoctree.render.trace(scene.octree, (0, -0.5, -2), directions, tan_half_angle=tan_half_angle)

Arrays are float32 in metres and linear radiance. Tensors of other libraries are accepted if they are in CPU memory.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from lightoctree import _lightoctree
from lightoctree._inputs import floats
from lightoctree._lightoctree import Octree

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import ArrayLike, NDArray

__all__ = ["Octree", "panorama_rays", "trace", "trace_backward"]


def trace(
    octree: Octree,
    origins: ArrayLike,
    directions: ArrayLike,
    *,
    tan_half_angle: ArrayLike = 0.0,
    rgba: ArrayLike | None = None,
) -> NDArray[np.float32]:
    """Traces cones and returns their samples, float32 [..., 5]: radiance, expected distance in metres, opacity.

    Parameters
    ----------
    octree
        `Scene.octree`, or an `Octree.from_points`.
    origins, directions
        Apexes in metres and axes of the cones, [..., 3]; they are broadcast against each other. Axes of any length.
    tan_half_angle
        Tangent of the half-angle, [...]; 0 is a ray.
    rgba
        Radiance and opacity of the octree's rows, [rows, 4], instead of `octree.rgba`.
    """
    shape, (apexes, axes, tangents) = _cones(origins, directions, tan_half_angle)
    return _lightoctree.trace(octree, apexes, axes, tangents, _features(rgba)).reshape(*shape, 5)


def trace_backward(
    octree: Octree,
    origins: ArrayLike,
    directions: ArrayLike,
    d_samples: ArrayLike,
    *,
    tan_half_angle: ArrayLike = 0.0,
    rgba: ArrayLike | None = None,
) -> NDArray[np.float32]:
    """Returns the derivative of a loss by the octree's rows, float32 [rows, 4].

    `d_samples` [..., 5] are the derivatives of the loss by the samples that `trace` returns for the same arguments.
    The result is exact, except that it is 0 for an opacity outside of [0, 0.9999], where tracing clamps it.
    """
    shape, (apexes, axes, tangents) = _cones(origins, directions, tan_half_angle)
    derivatives = floats("d_samples", d_samples)
    if derivatives.shape != (*shape, 5):
        raise ValueError(f"d_samples has the shape {derivatives.shape}; expected {(*shape, 5)}")
    rows = derivatives.reshape(-1, 5)
    return _lightoctree.trace_backward(octree, apexes, axes, tangents, rows, _features(rgba))


def panorama_rays(height: int) -> tuple[NDArray[np.float32], float]:
    """Returns the directions of a panorama's pixels, float32 [height, 2 * height, 3], and the tangent of their
    half-angle. The centre faces −Z, +Y is up."""
    import numpy as np

    pitch = np.pi / height
    polar = (np.arange(height) + 0.5) * pitch
    azimuth = (np.arange(2 * height) + 0.5) * pitch - np.pi
    sine = np.sin(polar)[:, None]
    directions = np.empty((height, 2 * height, 3), dtype=np.float32)
    directions[..., 0] = sine * np.sin(azimuth)
    directions[..., 1] = np.cos(polar)[:, None]
    directions[..., 2] = -sine * np.cos(azimuth)
    return directions, float(np.tan(pitch / 2))


def _cones(
    origins: Any, directions: Any, tan_half_angle: Any
) -> tuple[tuple[int, ...], tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.float32]]]:
    """Returns the common shape of the cones, and their origins, unit directions and tangents as rows."""
    import numpy as np

    apexes, axes = floats("origins", origins), floats("directions", directions)
    tangents = floats("tan_half_angle", tan_half_angle)
    for name, vectors in (("origins", apexes), ("directions", axes)):
        if vectors.ndim < 1 or vectors.shape[-1] != 3:
            raise ValueError(f"{name} has the shape {vectors.shape}; expected (..., 3)")
    shape = np.broadcast_shapes(apexes.shape[:-1], axes.shape[:-1], tangents.shape)
    lengths = np.linalg.norm(axes.astype(np.float64), axis=-1, keepdims=True)
    if not (lengths > 0).all():
        raise ValueError("directions contains a vector of length 0")
    if (tangents < 0).any():
        raise ValueError("tan_half_angle must not be negative")
    axes = (axes / lengths).astype(np.float32)
    flat = [np.broadcast_to(vectors, (*shape, 3)).reshape(-1, 3) for vectors in (apexes, axes)]
    first, second = (np.ascontiguousarray(vectors) for vectors in flat)
    return shape, (first, second, np.ascontiguousarray(np.broadcast_to(tangents, shape).reshape(-1)))


def _features(rgba: Any) -> NDArray[np.float32] | None:
    return None if rgba is None else floats("rgba", rgba)
