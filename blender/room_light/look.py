"""Settings of the scene that a room needs, and their former values."""

import json

from . import compositing, empty
from .lighting import world_of
from .names import MADE, ROLE, part, photo, rooms

COMPOSITING = "render.use_compositing"
# Blender shows the photo unchanged in these.
SETTINGS = {
    "render.film_transparent": True,
    "view_settings.view_transform": "Standard",
    "view_settings.look": "None",
    "view_settings.exposure": 0.0,
    "view_settings.gamma": 1.0,
    "render.pixel_aspect_x": 1.0,
    "render.pixel_aspect_y": 1.0,
}


def activate(scene, collection):
    """Renders the scene in this room: its camera, size, world and compositor. Returns what the user has to do.

    On the room in which the scene is rendered already, this brings the compositor up to date. The size stays then.
    """
    settings = scene.room_light
    world, camera = world_of(collection), part(collection, "Camera")
    wanted = SETTINGS | ({} if settings.active == collection else size_of(collection))
    if not settings.before:
        kept = [*wanted, COMPOSITING]
        settings.before = json.dumps({path: [get(scene, path)] for path in kept})
        settings.before_camera, settings.before_world = scene.camera, scene.world
    for path, value in wanted.items():
        set_(scene, path, value)
    remember(settings, wanted)
    scene.camera, scene.world = camera, world
    settings.active = collection
    show_only(scene, collection)
    if scene.render.engine == "CYCLES":
        empty.leave(scene)
    else:
        empty.prepare(scene, collection)
    messages = compositing.connect(scene, collection)
    if not messages:
        remember(settings, {COMPOSITING: True})
    return messages


def remember(settings, values):
    """Notes to what settings were set, beside their former values."""
    before = json.loads(settings.before)
    for path, value in values.items():
        before[path] = [before[path][0], value]
    settings.before = json.dumps(before)


def is_current(scene, collection):
    """Returns whether `activate` would change nothing: the engine, the size and the collections are as they were."""
    is_cycles = scene.render.engine == "CYCLES"
    if not (is_cycles or empty.is_prepared(scene, collection)):
        return False
    return compositing.is_current(scene, collection)


def restore(scene):
    """Gives the scene back what it had before its first room. What the user changed meanwhile stays."""
    settings = scene.room_light
    if not settings.before:
        return
    # "Look" depends on the view transform.
    for path, (before, *now) in json.loads(settings.before).items():
        if [get(scene, path)] == now:
            set_(scene, path, before)
    if scene.camera is None or scene.camera.get(ROLE):
        scene.camera = settings.before_camera
    if scene.world is None or scene.world.get(MADE):
        scene.world = settings.before_world
    compositing.disconnect(scene)
    empty.leave(scene)
    settings.before = ""
    settings.before_camera = settings.before_world = settings.active = None


def size_of(collection):
    """Returns the settings of the photo's size."""
    return dict(zip(("render.resolution_x", "render.resolution_y"), photo(collection).size))


def show_only(scene, collection):
    """Hides all other rooms."""
    for other in rooms(scene):
        other.hide_render = other.hide_viewport = other != collection


def get(scene, path):
    owner, name = path.split(".")
    return getattr(getattr(scene, owner), name)


def set_(scene, path, value):
    owner, name = path.split(".")
    setattr(getattr(scene, owner), name, value)
