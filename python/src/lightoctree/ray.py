"""Many photos on many machines by Ray Data, which `pip install 'lightoctree[ray]'` installs.

    results = lightoctree.ray.photos("s3://bucket/photos").map_batches(
        lightoctree.ray.Estimate,
        fn_constructor_kwargs={"root": "s3://bucket/photos", "output": "s3://bucket/scenes"},
        batch_size=1,
        num_cpus=1,
        compute=ray.data.ActorPoolStrategy(min_size=1, max_size=64),
    )
    results.write_parquet("s3://bucket/results")

docs/cluster.md describes columns, files and failures.
"""

from __future__ import annotations

import importlib.util
import inspect
import json
import os
import posixpath
import sys
import tempfile
import time
import traceback
import uuid
import warnings
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from lightoctree import data
from lightoctree._errors import LightOctreeError, LightOctreeWarning
from lightoctree._lightoctree import Scene, __version__, estimate

if importlib.util.find_spec("ray") is None or importlib.util.find_spec("pyarrow") is None:
    raise ImportError("lightoctree.ray needs Ray and PyArrow: pip install 'lightoctree[ray]'")

import pyarrow as pa  # type: ignore[import-untyped, unused-ignore]
from pyarrow import fs  # type: ignore[import-untyped, unused-ignore]

if TYPE_CHECKING:
    import ray.data

__all__ = ["Estimate", "photos", "rooms"]

MANIFEST = "lightoctree.json"
"""File of an output folder with the settings of its results."""

EXTENSIONS = frozenset(
    ("bmp exr gif hdr heic heif hif jpeg jpg jxl pam pbm pfm pgm pic png pnm ppm rgbe tif tiff webp").split()
)
"""Extensions of photos in folders, as of the command `batch`."""

# Object stores show a file when it is closed; elsewhere it is renamed when it is complete.
_WRITE_AT_ONCE = ("s3", "gcs", "abfs")

_SCHEMA = pa.schema(
    {
        "path": pa.string(),
        "scene": pa.string(),
        "envmap": pa.string(),
        "kept": pa.bool_(),
        "seconds": pa.float64(),
        "warnings": pa.list_(pa.string()),
        "error": pa.string(),
    }
)


def photos(root: str, *, filesystem: Any = None) -> ray.data.Dataset:
    """Lists the photos of a folder and its subfolders, except hidden files, as a dataset with a column `path`.

    `root` is a folder or URI. `Estimate` reads the photos where it runs: neither the driver nor Ray's object store
    holds them.
    """
    import ray.data

    source, folder = _opened(root, filesystem)
    prefix = root.partition("://")[0] + "://" if "://" in root else ""
    infos = source.get_file_info(fs.FileSelector(folder, recursive=True))
    inside = {info.path: info.path.removeprefix(folder).strip("/") for info in infos if info.is_file}
    names = [path for path, name in inside.items() if _is_photo(name)]
    if not names:
        raise FileNotFoundError(f"no photos in {root}")
    rows = [{"path": prefix + name} for name in sorted(names)]
    return ray.data.from_items(rows, override_num_blocks=min(len(rows), 1000))


def _is_photo(name: str) -> bool:
    is_hidden = any(part.startswith(".") for part in name.split("/"))
    return not is_hidden and posixpath.splitext(name)[1][1:].lower() in EXTENSIONS


class Estimate:
    """Estimates a scene from each photo of a batch, for `ray.data.Dataset.map_batches`.

    A batch has a column `path`, and `bytes` (of `read_binary_files`, with EXIF and colour profile) or `image` (of
    `read_images`, arrays [H, W, 3]); with `path` alone, the photos are read from there. The results are files in
    `output` and a table with a row for each photo: `path`, `scene`, `envmap` (paths of the files), `kept`, `seconds`,
    `warnings` and `error`. A photo that cannot be used has an error and no files; a result that cannot be written is an
    exception. Finished results are kept, so that a job can be repeated.
    """

    def __init__(
        self,
        output: str,
        *,
        root: str | None = None,
        scenes: bool = True,
        envmap: Mapping[str, Any] | None = None,
        filesystem: Any = None,
        **options: Any,
    ) -> None:
        """Opens the output folder.

        Parameters
        ----------
        output
            Folder or URI, such as "s3://bucket/scenes".
        root
            Folder or URI of the photos. The photo `root/kitchen/a.jpg` becomes `kitchen/a.jpg.scene` in `output`.
            Default: results are named after the whole paths.
        scenes
            Whether scene files are written. They contain the uncompressed photo.
        envmap
            Parameters of `Scene.save_environment`, such as {"at": (0, 0, -1), "level": True}; the environment map is
            written as `kitchen/a.jpg.exr`. Default: none.
        filesystem
            File system of PyArrow or fsspec in which `output` is a path. Default: that of the URI.
        options
            Parameters of `lightoctree.estimate`, such as hfov_deg=65.
        """
        inspect.signature(estimate).bind(None, **options)
        if envmap is not None:
            inspect.signature(Scene.save_environment).bind(None, None, **envmap)
        if not scenes and envmap is None:
            raise ValueError("without scenes and envmap there are no results")
        if options.keys() & {"depth", "panorama", "on_event"}:
            raise ValueError("depth, panorama and on_event apply to single photos")
        _use_assigned_cpus()
        self._fs, self._output = _opened(output, filesystem)
        self._root = None if root is None else _opened(root, None)[1]
        self._scenes, self._envmap, self._options = scenes, envmap, options
        self._check_settings()

    def __call__(self, batch: Any) -> pa.Table:
        """Estimates the photos of a batch."""
        columns: Mapping[str, Any] = batch.to_pydict() if isinstance(batch, pa.Table) else batch
        if "path" not in columns:
            raise ValueError("a batch needs the column path; read photos with include_paths=True")
        rows = []
        for index, path in enumerate(columns["path"]):
            given = next((columns[name][index] for name in ("bytes", "image") if name in columns), None)
            rows.append(self._row(str(path), given))
        return pa.Table.from_pylist(rows, _SCHEMA)

    def _row(self, path: str, given: Any) -> dict[str, Any]:
        begun = time.monotonic()
        row: dict[str, Any] = {"path": path, "kept": False, "warnings": []}
        try:
            name = self._name(path)
        except ValueError as error:
            return {**row, "error": str(error), "seconds": 0.0}
        files = {}
        if self._envmap is not None:
            files["envmap"] = posixpath.join(self._output, name + ".exr")
        # The last one.
        if self._scenes:
            files["scene"] = posixpath.join(self._output, name + ".scene")
        if all(info.is_file and info.size for info in self._fs.get_file_info(list(files.values()))):
            return {**row, **files, "kept": True, "seconds": time.monotonic() - begun}
        try:
            with warnings.catch_warnings(record=True) as caught:
                warnings.simplefilter("always")
                results = self._results(path, name, given)
        except MemoryError:
            raise
        except Exception as error:
            return {**row, "error": _text(error), "seconds": time.monotonic() - begun}
        for kind, file in files.items():
            self._write(file, results[kind])
        told = [str(warning.message) for warning in caught if issubclass(warning.category, LightOctreeWarning)]
        return {**row, **files, "warnings": told, "seconds": time.monotonic() - begun}

    def _results(self, path: str, name: str, given: Any) -> dict[str, bytes]:
        """Returns the bytes of the result files."""
        results = {}
        with tempfile.TemporaryDirectory(prefix="lightoctree-") as folder:
            scene = self._estimate(path, Path(folder, posixpath.basename(name)), given)
            if self._envmap is not None:
                file = Path(folder, "envmap.exr")
                scene.save_environment(file, **self._envmap)
                results["envmap"] = file.read_bytes()
        if self._scenes:
            results["scene"] = scene.to_bytes()
        return results

    def _estimate(self, path: str, copy: Path, given: Any) -> Scene:
        if isinstance(given, np.ndarray):
            return estimate(given, **self._options)
        if given is None:
            source, inside = _opened(path, None)
            if isinstance(source, fs.LocalFileSystem):
                return estimate(inside, **self._options)
            with source.open_input_file(inside) as file:
                given = file.read()
        # A file with the photo's name, which the scene stores.
        copy.write_bytes(given)
        try:
            return estimate(copy, **self._options)
        except (LightOctreeError, OSError) as error:
            raise LightOctreeError(_text(error).replace(str(copy), path)) from error

    def _name(self, path: str) -> str:
        """Returns the path of a photo in the root folder."""
        inside = posixpath.normpath(_opened(path, None)[1] if "://" in path else path)
        if self._root is None:
            name = inside.lstrip("/")
            if name == "." or name.split("/")[0] == "..":
                raise ValueError(f"{path!r} is not the path of a photo")
            return name
        root = posixpath.normpath(self._root)
        if posixpath.isabs(root):
            inside = os.path.abspath(inside)
        if not inside.startswith(root.rstrip("/") + "/"):
            raise ValueError(f"{path} is outside of the root {self._root}")
        return inside.removeprefix(root).lstrip("/")

    def _check_settings(self) -> None:
        settings = {
            "lightoctree": __version__,
            "scenes": self._scenes,
            "envmap": self._envmap,
            "options": self._options,
        }
        text = json.dumps(settings, indent=2, sort_keys=True, default=_jsonable)
        path = posixpath.join(self._output, MANIFEST)
        if self._fs.get_file_info(path).type == fs.FileType.NotFound:
            self._write(path, text.encode())
            return
        with self._fs.open_input_stream(path) as file:
            existing = json.loads(file.read())
        now = json.loads(text)
        for key, value in now.items():
            if existing.get(key) != value:
                reason = f"{key} was {existing.get(key)}, now it is {value}"
                raise ValueError(f"{self._output} has results of other settings: {reason}; choose another folder")

    def _write(self, path: str, contents: bytes) -> None:
        """Writes a file that nobody sees before it is complete."""
        if self._fs.type_name in _WRITE_AT_ONCE:
            with self._fs.open_output_stream(path) as file:
                file.write(contents)
            return
        folder, name = posixpath.split(path)
        self._fs.create_dir(folder, recursive=True)
        temporary = posixpath.join(folder, f".{name}.{uuid.uuid4().hex}")
        try:
            with self._fs.open_output_stream(temporary) as file:
                file.write(contents)
            self._fs.move(temporary, path)
        except BaseException:
            if self._fs.get_file_info(temporary).type != fs.FileType.NotFound:
                self._fs.delete_file(temporary)
            raise


def rooms(count: int, *, seed: int = 0, config: Mapping[str, Any] | None = None) -> ray.data.Dataset:
    """Returns generated rooms as a dataset of Ray, a row for each photo, generated where they are used.

    The rows are those of `lightoctree.data.rooms`. Arrays of the views are stacked: `views_position_m` [V, 3],
    `views_rotation_xyzw` [V, 4], `views_radiance` [V, H, W, 3], `views_depth_m` [V, H, W]; `metadata` is JSON. Column
    `room` is the number of the room.
    """
    import ray.data

    # Wrong configurations are refused here.
    data.rooms(count, seed=seed, config=config)
    arguments = {"count": count, "seed": seed, "config": None if config is None else dict(config)}
    # Ray's type of a function has no further arguments.
    generate: Any = _room_rows
    # Generated on demand: a block of the range for each room.
    numbers = ray.data.range(count, override_num_blocks=max(1, min(count, 1000)))
    return numbers.map_batches(generate, batch_size=1, fn_kwargs=arguments)


def _room_rows(
    batch: Mapping[str, Any], count: int, seed: int, config: Mapping[str, Any] | None
) -> Iterator[dict[str, Any]]:
    _use_assigned_cpus()
    samples = data.rooms(count, seed=seed, config=config)
    shots = len(samples) // count
    for room in batch["id"]:
        for index in range(int(room) * shots, int(room) * shots + shots):
            row = _flat(samples[index])
            yield {"room": np.array([room]), **{name: _column(value) for name, value in row.items()}}


def _flat(sample: data.Sample) -> dict[str, Any]:
    """Returns a sample without nested values."""
    row: dict[str, Any] = dict(sample)
    views = row.pop("views", [])
    for name, shape in (("position_m", (3,)), ("rotation_xyzw", (4,)), ("radiance", (0, 0, 3)), ("depth_m", (0, 0))):
        values = [np.asarray(view[name], np.float32) for view in views if name in view]
        row[f"views_{name}"] = np.stack(values) if values else np.zeros((0, *shape), np.float32)
    row["metadata"] = json.dumps(row.get("metadata", {}), default=_jsonable)
    return row


def _column(value: Any) -> Any:
    """Returns a column with one row."""
    return [value] if isinstance(value, str) else np.asarray(value)[np.newaxis]


def _use_assigned_cpus() -> None:
    """Limits the library to the CPUs that Ray assigns to this worker, before it starts its threads."""
    ray = sys.modules.get("ray")
    if ray is None or not ray.is_initialized() or "RAYON_NUM_THREADS" in os.environ:
        return
    context = ray.get_runtime_context()
    if context.get_task_id() is not None or context.get_actor_id() is not None:
        cpus = context.get_assigned_resources().get("CPU", 1)
        os.environ["RAYON_NUM_THREADS"] = str(max(1, int(cpus)))


def _opened(path: str, filesystem: Any) -> tuple[Any, str]:
    """Returns the file system of a path or URI, and the path in it."""
    if filesystem is None and "://" in path:
        opened = fs.FileSystem.from_uri(path)
        return opened[0], opened[1]
    if filesystem is None:
        return fs.LocalFileSystem(), Path(os.path.abspath(path)).as_posix()
    if not isinstance(filesystem, fs.FileSystem):
        filesystem = fs.PyFileSystem(fs.FSSpecHandler(filesystem))
    return filesystem, path.rstrip("/")


def _text(error: BaseException) -> str:
    """Returns the message of an exception, with its type unless the message is written for users."""
    if isinstance(error, (LightOctreeError, OSError)):
        return str(error)
    return traceback.format_exception_only(error)[-1].strip()


def _jsonable(value: Any) -> Any:
    if isinstance(value, os.PathLike):
        return os.fsdecode(value)
    return value.tolist() if hasattr(value, "tolist") else str(value)
