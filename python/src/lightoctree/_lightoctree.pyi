from collections import abc
from collections.abc import Callable, Iterable, Mapping
from os import PathLike
from pathlib import Path
from typing import Any, Literal, Protocol, TypeAlias, final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lightoctree._types import Event, Light, MainLight
from lightoctree.data import Sample

class _DLPack(Protocol):
    def __dlpack__(self, *args: Any, **kwargs: Any) -> Any: ...
    def __dlpack_device__(self) -> tuple[Any, int]: ...

class _PILImage(Protocol):
    @property
    def mode(self) -> str: ...
    @property
    def size(self) -> tuple[int, int]: ...
    def getexif(self) -> Any: ...

_Path: TypeAlias = str | PathLike[str]
_Image: TypeAlias = _Path | ArrayLike | _DLPack | _PILImage
_Map: TypeAlias = _Path | ArrayLike | _DLPack
_Vector: TypeAlias = abc.Sequence[float] | NDArray[Any]
_Object: TypeAlias = Mapping[str, Any]
_LightMode: TypeAlias = Literal["even", "expected", "plausible"]
_Quality: TypeAlias = Literal["draft", "normal", "high"]
_Orientation: TypeAlias = Literal["lightoctree", "openexr", "threejs", "blender", "unity"]

__version__: str

def estimate(
    photo: _Image,
    *,
    depth: _Map | None = None,
    depth_is: Literal["measured", "predicted", "inverse"] = "measured",
    intrinsics: _Map | None = None,
    hfov_deg: float | None = None,
    up: _Vector | None = None,
    panorama: _Image | Panorama | None = None,
    depth_model: _Path | None = None,
    weights: _Path | None = None,
    seed: int = 0,
    on_event: Callable[[Event], object] | None = None,
) -> Scene: ...
def main() -> int: ...
def trace(
    octree: Octree,
    origins: NDArray[np.float32],
    directions: NDArray[np.float32],
    tan_half_angles: NDArray[np.float32],
    rgba: NDArray[np.float32] | None,
) -> NDArray[np.float32]: ...
def trace_backward(
    octree: Octree,
    origins: NDArray[np.float32],
    directions: NDArray[np.float32],
    tan_half_angles: NDArray[np.float32],
    d_samples: NDArray[np.float32],
    rgba: NDArray[np.float32] | None,
) -> NDArray[np.float32]: ...
def rooms(count: int, *, seed: int = 0, config: Mapping[str, Any] | None = None) -> Dataset: ...
def read(path: _Path, *, seed: int = 0) -> Dataset: ...
@final
class Dataset:
    def __len__(self) -> int: ...
    def __getitem__(self, index: int, /) -> Sample: ...
    def __iter__(self) -> abc.Iterator[Sample]: ...
    def split(self, index: int) -> Literal["train", "validation", "test"]: ...

@final
class Panorama:
    def __new__(
        cls,
        image: _Image,
        *,
        at: _Vector = (0, 0, 0),
        orientation: _Orientation = "lightoctree",
        yaw_deg: float | None = None,
        exposure_ev: float | None = None,
    ) -> Panorama: ...

@final
class Scene:
    @classmethod
    def load(cls, path: _Path) -> Scene: ...
    @classmethod
    def from_bytes(cls, data: bytes) -> Scene: ...
    def save(self, path: _Path) -> None: ...
    def to_bytes(self) -> bytes: ...
    def environment(
        self,
        at: _Vector,
        size: tuple[int, int] = (512, 256),
        level: bool = False,
        *,
        light: _LightMode | None = None,
    ) -> NDArray[np.float32]: ...
    def save_environment(
        self,
        path: _Path,
        at: _Vector,
        size: tuple[int, int] = (512, 256),
        level: bool = False,
        *,
        light: _LightMode | None = None,
        orientation: _Orientation = "lightoctree",
        half: bool = False,
    ) -> None: ...
    def sh9(self, at: _Vector, level: bool = False, *, light: _LightMode | None = None) -> NDArray[np.float32]: ...
    def main_light(self, at: _Vector, level: bool = False, *, light: _LightMode | None = None) -> MainLight | None: ...
    def light_estimate(
        self,
        at: _Vector,
        layout: Literal["webxr", "arkit", "unity"],
        level: bool = False,
        *,
        light: _LightMode | None = None,
    ) -> dict[str, Any]: ...
    def export(
        self,
        path: _Path,
        *,
        level: bool = False,
        probes: abc.Sequence[_Vector] = (),
        light: _LightMode | None = None,
    ) -> list[Path]: ...
    def export_web(self, folder: _Path, *, title: str = "", light: _LightMode | None = None) -> list[Path]: ...
    def surface_at_pixel(self, pixel: _Vector) -> tuple[tuple[float, float, float], tuple[float, float, float]]: ...
    def insert(
        self,
        objects: _Object | Iterable[_Object] | _Path | None = None,
        *,
        quality: _Quality = "normal",
        light: _LightMode | None = None,
        floor_gloss: float | None = None,
        match_look: bool = True,
        passes: bool = False,
        on_event: Callable[[Event], object] | None = None,
    ) -> Composite: ...
    def sequence(
        self,
        objects: _Object | Iterable[_Object] | _Path | None = None,
        frames: int | None = None,
        *,
        quality: _Quality = "normal",
        light: _LightMode | None = None,
        floor_gloss: float | None = None,
        match_look: bool = True,
        passes: bool = False,
        on_event: Callable[[Event], object] | None = None,
    ) -> Sequence: ...
    @property
    def lights(self) -> list[Light]: ...
    def set_light(
        self,
        id: str,
        *,
        on: bool | None = None,
        scale: float | None = None,
        color: float | _Vector | None = None,
        at: _Vector | None = None,
    ) -> None: ...
    def add_sun(
        self,
        *,
        azimuth_deg: float | None = None,
        elevation_deg: float | None = None,
        shadow: _Vector | None = None,
        strength: float | None = None,
        angle_deg: float = 0.53,
        color: float | _Vector | None = None,
    ) -> str: ...
    def add_area_light(
        self,
        at: _Vector,
        *,
        size: _Vector | None = None,
        radius: float | None = None,
        direction: _Vector | None = None,
        two_sided: bool = False,
        radiance: float | None = None,
        power: float | None = None,
        color: float | _Vector | None = None,
    ) -> str: ...
    def remove_light(self, id: str) -> None: ...
    def reset_lights(self, id: str | None = None) -> None: ...
    @property
    def octree(self) -> Octree: ...
    @property
    def photo(self) -> NDArray[np.uint8] | NDArray[np.float32]: ...
    @property
    def depth(self) -> NDArray[np.float32]: ...
    @property
    def intrinsics(self) -> tuple[float, float, float, float]: ...
    @property
    def up(self) -> tuple[float, float, float] | None: ...
    def __copy__(self) -> Scene: ...
    def __reduce__(self) -> tuple[Callable[[bytes], Scene], tuple[bytes]]: ...
    def _repr_png_(self) -> bytes: ...

@final
class Sequence:
    def __iter__(self) -> Sequence: ...
    def __next__(self) -> Composite: ...
    def __len__(self) -> int: ...

@final
class Composite:
    @property
    def image(self) -> NDArray[np.uint8] | NDArray[np.float32]: ...
    @property
    def layers(self) -> dict[str, NDArray[np.float32]]: ...
    @property
    def object_mattes(self) -> dict[str, NDArray[np.float32]]: ...
    @property
    def material_mattes(self) -> dict[str, NDArray[np.float32]]: ...
    def save(self, path: _Path) -> None: ...
    def save_layers(self, path: _Path) -> None: ...
    def _repr_png_(self) -> bytes: ...

@final
class Octree:
    @classmethod
    def from_points(
        cls,
        positions_m: ArrayLike | _DLPack,
        radiance: ArrayLike | _DLPack,
        *,
        depth: int = 7,
        full_depth: int = 3,
        cube: tuple[float, float, float, float] | None = None,
    ) -> Octree: ...
    @property
    def rgba(self) -> NDArray[np.float32]: ...
    @property
    def depth(self) -> int: ...
    @property
    def full_depth(self) -> int: ...
    @property
    def origin_m(self) -> tuple[float, float, float]: ...
    @property
    def edge_m(self) -> float: ...
    @property
    def levels(self) -> list[OctreeLevel]: ...
    def leaves(self) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.float32]]: ...

@final
class OctreeLevel:
    @property
    def keys(self) -> NDArray[np.uint32]: ...
    @property
    def children(self) -> NDArray[np.int32]: ...
    @property
    def rows(self) -> NDArray[np.int32]: ...
    @property
    def rgba(self) -> NDArray[np.float32]: ...
    @property
    def seen(self) -> NDArray[np.uint8]: ...
    @property
    def lobes(self) -> NDArray[np.float32] | None: ...
