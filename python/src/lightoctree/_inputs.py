"""Conversion of what users pass to paths, bytes and arrays that the native module takes.

Images of PIL pass through a lossless file in memory, so that their profile and EXIF are read as those of files.
Tensors of PyTorch, JAX and others arrive by `__array__` or DLPack. Modules that only some inputs need are imported
with the first of them, so that the package starts quickly.
"""

from __future__ import annotations

import errno
import os
import stat
import sys
from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from numpy.typing import NDArray


def path(argument: str, value: Any) -> str:
    """Returns the path of an existing file."""
    if not isinstance(value, (str, bytes, os.PathLike)):
        raise TypeError(f"{argument} must be a path, not {_type(value)}")
    name = os.fsdecode(value)
    # Raises `FileNotFoundError` and others with the name.
    if stat.S_ISDIR(os.stat(name).st_mode):
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), name)
    return name


def image(argument: str, value: Any) -> str | bytes | NDArray[Any]:
    """Returns a path, the bytes of a file, or an array [H, W, 3] of uint8, uint16 or float32 in C order."""
    if isinstance(value, (str, bytes, os.PathLike)):
        return path(argument, value)
    pil = sys.modules.get("PIL.Image")
    if pil is not None and isinstance(value, pil.Image) and value.mode not in ("F", "I"):
        return _encoded(value)
    pixels = _array(argument, value)
    shape = pixels.shape
    if pixels.ndim != 3 or shape[2] != 3:
        hint = ""
        if pixels.ndim == 3 and shape[0] == 3:
            hint = f"; move the channels last, for example {argument}.transpose(1, 2, 0)"
        elif pixels.ndim == 3 and shape[2] == 4:
            hint = f"; leave out the alpha channel, for example {argument}[..., :3]"
        raise ValueError(f"{argument} has the shape {shape}; expected (height, width, 3){hint}")
    if pixels.size == 0:
        raise ValueError(f"{argument} has the shape {shape} and no pixels")
    import numpy as np

    if pixels.dtype.kind == "u" and pixels.dtype.itemsize <= 2:
        return np.ascontiguousarray(pixels, dtype=pixels.dtype.newbyteorder("="))
    if pixels.dtype.kind == "f":
        return np.ascontiguousarray(pixels, dtype=np.float32)
    raise TypeError(f"{argument} is an array of {pixels.dtype}; expected uint8 or uint16 (sRGB), or floats (linear)")


def floats(argument: str, value: Any, finite: bool = True) -> NDArray[Any]:
    """Returns numbers as float32 in C order; with `finite`, NaN and infinity are refused."""
    import numpy as np

    array = _array(argument, value)
    if array.dtype.kind not in "fiu":
        raise TypeError(f"{argument} is an array of {array.dtype}; expected numbers")
    values = np.asarray(array, dtype=np.float32, order="C")
    if finite and not np.isfinite(values).all():
        raise ValueError(f"{argument} contains NaN or infinite numbers")
    return values


def depth(value: Any) -> str | bytes:
    """Returns a path, or the bytes of an NPY file with the array."""
    if isinstance(value, (str, bytes, os.PathLike)):
        return path("depth", value)
    values = _array("depth", value)
    if values.ndim != 2:
        hint = "; remove the axes of length 1, for example by depth.squeeze()" if values.squeeze().ndim == 2 else ""
        raise ValueError(f"depth has the shape {values.shape}; expected (height, width){hint}")
    if values.size == 0:
        raise ValueError(f"depth has the shape {values.shape} and no pixels")
    if values.dtype.kind != "f":
        hint = "convert it to metres, for example depth / 1000 for millimetres"
        raise TypeError(f"depth is an array of {values.dtype}; {hint}")
    import io

    import numpy as np

    file = io.BytesIO()
    np.save(file, values.astype(np.float32, order="C", copy=False))
    return file.getvalue()


def intrinsics(value: Any) -> str | tuple[float, float, float, float]:
    """Returns a path, or focal lengths and principal point."""
    if isinstance(value, (str, bytes, os.PathLike)):
        return path("intrinsics", value)
    numbers = _array("intrinsics", value).astype("float64")
    if numbers.shape == (3, 3):
        if numbers[0, 1] != 0 or numbers[1, 0] != 0 or tuple(numbers[2]) != (0, 0, 1):
            raise ValueError("intrinsics is not a camera matrix without skew: [[fx, 0, cx], [0, fy, cy], [0, 0, 1]]")
        numbers = numbers[[0, 1, 0, 1], [0, 1, 2, 2]]
    if numbers.shape != (4,):
        raise ValueError(f"intrinsics has the shape {numbers.shape}; expected (fx, fy, cx, cy) or a 3 × 3 matrix")
    fx, fy, cx, cy = numbers.tolist()
    return fx, fy, cx, cy


def layout(objects: Any) -> tuple[str, str]:
    """Returns the JSON of a layout, and the folder to which its paths are relative."""
    if isinstance(objects, (str, bytes, os.PathLike)):
        name = path("objects", objects)
        with open(name, encoding="utf-8") as file:
            return file.read(), os.path.dirname(name)
    listed = [objects] if isinstance(objects, Mapping) or not isinstance(objects, Iterable) else list(objects)
    for item in listed:
        if not isinstance(item, Mapping):
            raise TypeError(f"objects must be dictionaries, not {_type(item)}")
    return _dumps([dict(item) for item in listed]), ""


def json_text(fields: Any) -> str:
    """Returns the JSON of a configuration."""
    return _dumps(dict(fields))


def _dumps(value: Any) -> str:
    import json

    return json.dumps(value, default=_json)


def _json(value: Any) -> Any:
    if isinstance(value, os.PathLike):
        return os.fsdecode(value)
    if isinstance(value, Mapping):
        return dict(value)
    if hasattr(value, "tolist"):
        return value.tolist()
    raise TypeError(f"{_type(value)} cannot be used in objects")


def _array(argument: str, value: Any) -> NDArray[Any]:
    import numpy as np

    if isinstance(value, np.ma.MaskedArray):
        value = value.filled(0)
    if hasattr(value, "__dlpack__") and not hasattr(value, "__array__"):
        value = np.from_dlpack(value)
    array = np.asarray(value)
    if array.dtype == object:
        raise TypeError(f"{argument} must be a path or an array, not {_type(value)}")
    return array


def _encoded(value: Any) -> bytes:
    if value.mode not in ("1", "L", "LA", "P", "RGB", "RGBA", "I;16"):
        value = value.convert("RGB")
    import io

    file = io.BytesIO()
    value.save(file, "PNG", compress_level=1, exif=value.getexif(), icc_profile=value.info.get("icc_profile"))
    return file.getvalue()


def _type(value: Any) -> str:
    kind = type(value)
    return kind.__qualname__ if kind.__module__ == "builtins" else f"{kind.__module__}.{kind.__qualname__}"
