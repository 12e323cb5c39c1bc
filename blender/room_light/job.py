"""The estimate of a room on a thread of its own. This module does not use Blender."""

import os
import tempfile
import threading
import warnings
from dataclasses import dataclass, field

import lightoctree


class Cancelled(Exception):
    """The user cancelled the job."""


@dataclass(frozen=True)
class Request:
    """What to estimate a room from. Paths are absolute."""

    photo: str
    """Photo, or a .scene file."""
    depth: str = ""
    depth_is: str = "measured"
    panorama: str = ""
    hfov_deg: float = 0.0
    """Horizontal field of view; 0 if unknown."""
    light: str = "plausible"

    def estimate(self, on_event):
        if self.photo.lower().endswith(".scene"):
            return lightoctree.Scene.load(self.photo)
        options = {}
        if self.depth:
            options.update(depth=self.depth, depth_is=self.depth_is)
        if self.panorama:
            options["panorama"] = self.panorama
        if self.hfov_deg:
            options["hfov_deg"] = self.hfov_deg
        return lightoctree.estimate(self.photo, on_event=on_event, **options)


@dataclass
class Room:
    """An estimated room, exported to a temporary folder."""

    name: str
    scene: lightoctree.Scene
    folder: tempfile.TemporaryDirectory
    usd: str
    is_level: bool
    light: str
    warnings: list = field(default_factory=list)


class Job:
    """Estimates a room. `wait` returns it or raises the error."""

    def __init__(self, request):
        self._request = request
        self._cancelled = threading.Event()
        self._room = None
        self._error = None
        self._thread = threading.Thread(target=self._run, name="room light", daemon=True)
        self.stage = "starting"
        self.share = 0.0
        """Done share of the stage, from 0 to 1."""
        self.warnings = []

    def start(self):
        self._thread.start()
        return self

    def cancel(self):
        self._cancelled.set()

    def is_running(self):
        return self._thread.is_alive()

    def wait(self):
        self._thread.join()
        if self._error is not None:
            raise self._error
        return self._room

    def _run(self):
        try:
            with warnings.catch_warnings():
                # They arrive as events, too.
                warnings.simplefilter("ignore", lightoctree.LightOctreeWarning)
                self._room = self._make()
        except Exception as error:
            self._error = Cancelled() if self._cancelled.is_set() else error

    def _make(self):
        request = self._request
        scene = request.estimate(self._receive)
        self._check()
        self.stage, self.share = "exporting", 0.0
        folder = tempfile.TemporaryDirectory(prefix="room-light-")
        usd = os.path.join(folder.name, "room.usda")
        is_level = scene.up is not None
        try:
            scene.export(usd, level=is_level, light=request.light)
            self._check()
        except BaseException:
            folder.cleanup()
            raise
        name = os.path.splitext(os.path.basename(request.photo))[0]
        return Room(name, scene, folder, usd, is_level, request.light, self.warnings)

    def _check(self):
        if self._cancelled.is_set():
            raise Cancelled

    def _receive(self, event):
        self._check()
        if event.kind == "warning":
            self.warnings.append(event.message)
        elif event.kind == "begun":
            self.stage, self.share = event.stage, 0.0
        elif event.kind == "progress" and event.total:
            self.share = event.done / event.total
