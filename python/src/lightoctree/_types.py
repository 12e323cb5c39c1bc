"""Plain values that the native module returns."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

Vector = tuple[float, float, float]


@dataclass(frozen=True)
class Event:
    """An event of a running job."""

    kind: Literal["begun", "progress", "done", "figures", "warning"]
    """Kind of event; it determines which of the other values are set."""
    stage: str | None = None
    """Name of the stage; of all kinds but `warning`."""
    done: int | None = None
    """Number of steps done; of `progress`."""
    total: int | None = None
    """Number of all steps; of `progress`."""
    seconds: float | None = None
    """Duration of the stage; of `done`."""
    figures: Mapping[str, float] | None = None
    """Measured values by name; of `figures`."""
    message: str | None = None
    """Message; of `warning`."""


@dataclass(frozen=True)
class MainLight:
    """The light that contributes the most power at a position."""

    direction: Vector
    """Unit vector towards the light."""
    solid_angle_sr: float
    """Solid angle in steradians."""
    radiance: Vector
    """Mean linear RGB radiance."""
    power: Vector
    """Linear RGB irradiance on a surface that faces the light."""
    share: float
    """Share of the light that arrives at the position, from 0 to 1."""

    @classmethod
    def _of(cls, values: dict[str, Any]) -> MainLight:
        return cls(**_tuples(values))


@dataclass(frozen=True)
class LightChange:
    """The user's edit of a light."""

    on: bool = True
    """Whether it is on."""
    scale: float = 1.0
    """Factor on its radiance."""
    color: float | Vector | None = None
    """New colour: a temperature in kelvin or linear RGB."""
    at_m: Vector | None = None
    """New position of its centre in metres."""

    @classmethod
    def _of(cls, values: dict[str, Any]) -> LightChange:
        return cls(**values)


@dataclass(frozen=True)
class Light:
    """A light of a scene, before its edit. What does not apply to its shape is None."""

    id: str
    """Name of the light."""
    kind: Literal["lamp", "window", "bright-surface", "area", "sun"]
    """Kind of light."""
    origin: Literal["observed", "panorama", "inferred", "added"]
    """Source of the light."""
    radiance: Vector
    """Mean linear RGB radiance."""
    position_m: Vector | None = None
    """Centre in metres; of all but a sun."""
    direction: Vector | None = None
    """Unit direction of emission; of a sun, the direction towards it."""
    size_m: tuple[float, float] | None = None
    """Width and height of a rectangle in metres."""
    radius_m: float | None = None
    """Radius of a sphere in metres."""
    angular_radius_deg: float | None = None
    """Angular radius of a sun in degrees."""
    area_m2: float | None = None
    """Emitting area in m²; of all but a sun."""
    irradiance: float | None = None
    """Luminance of the irradiance on a surface that faces a sun."""
    color_temperature_k: float | None = None
    """Colour temperature in kelvin, where the colour is near that of a black body."""
    flux_share: float | None = None
    """Share of the light that the room's surfaces emit; not of added lights."""
    certainty: float | None = None
    """Confidence from 0 to 1; of inferred lights."""
    change: LightChange | None = None
    """The user's edit."""

    @classmethod
    def _of(cls, values: dict[str, Any]) -> Light:
        return cls(**_tuples(values))


def _tuples(values: dict[str, Any]) -> dict[str, Any]:
    return {name: tuple(value) if isinstance(value, list) else value for name, value in values.items()}
