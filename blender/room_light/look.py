"""Settings of the scene that a room needs, and their former values."""

import json

from . import build, compositing, empty

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
    """Renders the scene in this room: its camera, size, world and compositor. Returns what the user has to do."""
    settings = scene.room_light
    room = collection.room_light
    width, height = room.photo.size
    wanted = SETTINGS | {"render.resolution_x": width, "render.resolution_y": height}
    if not settings.before:
        settings.before = json.dumps({path: get(scene, path) for path in wanted})
        settings.before_camera, settings.before_world = scene.camera, scene.world
    for path, value in wanted.items():
        set_(scene, path, value)
    scene.camera, scene.world = room.camera, room.world
    settings.active = collection
    show_only(scene, collection)
    if scene.render.engine == "CYCLES":
        empty.leave(scene)
    else:
        empty.prepare(scene, collection)
    group, is_connected = compositing.connect(scene, room)
    if is_connected:
        return []
    return [f"The scene has compositor nodes: put the node group {group.name!r} before the output"]


def restore(scene):
    """Gives the scene back what it had before its first room. What the user changed meanwhile stays."""
    settings = scene.room_light
    room = settings.active.room_light if settings.active else None
    if not settings.before:
        return
    before = json.loads(settings.before)
    wanted = dict(SETTINGS)
    if room is not None and room.photo is not None:
        wanted |= dict(zip(("render.resolution_x", "render.resolution_y"), room.photo.size))
    # "Look" depends on the view transform.
    for path, value in before.items():
        if get(scene, path) == wanted.get(path):
            set_(scene, path, value)
    if room is None or scene.camera == room.camera:
        scene.camera = settings.before_camera
    if room is None or scene.world == room.world:
        scene.world = settings.before_world
    compositing.disconnect(scene)
    empty.leave(scene)
    settings.before = ""
    settings.before_camera = settings.before_world = settings.active = None


def show_only(scene, collection):
    """Hides all other rooms."""
    for other in build.rooms(scene):
        other.hide_render = other.hide_viewport = other != collection


def get(scene, path):
    owner, name = path.split(".")
    return getattr(getattr(scene, owner), name)


def set_(scene, path, value):
    owner, name = path.split(".")
    setattr(getattr(scene, owner), name, value)
