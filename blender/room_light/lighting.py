"""What lights the objects: the room's surfaces and lamps, or the panorama at one object."""

import warnings

import bpy
import lightoctree
import numpy as np
from mathutils import Matrix, Vector

from .names import ROLE, SCENE

# Height of the default place above its surface.
ABOVE_M = 0.15
# Twice the photo's white: lamps and windows.
SUN_THRESHOLD = 2.0
# Width of a panorama in pixels; the height is half of it.
WIDTH = 1024
# From the camera's frame, +Y up and −Z ahead, to that of Blender's environments, +Z up and +Y ahead.
UPRIGHT = Matrix(((1.0, 0.0, 0.0), (0.0, 0.0, -1.0), (0.0, 1.0, 0.0)))


def new_world(name):
    """A black world, for the light that gets through gaps of the room."""
    world = bpy.data.worlds.new(f"{name} Environment")
    if not world.use_nodes:
        world.use_nodes = True
    tree = world.node_tree
    tree.nodes.clear()
    place = {name: tree.nodes.new(f"ShaderNode{name}") for name in ("TexCoord", "Mapping", "TexEnvironment")}
    background, output = tree.nodes.new("ShaderNodeBackground"), tree.nodes.new("ShaderNodeOutputWorld")
    tree.links.new(place["TexCoord"].outputs["Generated"], place["Mapping"].inputs["Vector"])
    tree.links.new(place["Mapping"].outputs["Vector"], place["TexEnvironment"].inputs["Vector"])
    tree.links.new(place["TexEnvironment"].outputs["Color"], background.inputs["Color"])
    tree.links.new(background.outputs["Background"], output.inputs["Surface"])
    background.inputs["Strength"].default_value = 0.0
    # Of EEVEE, which makes a sun of all brighter light.
    world.sun_threshold, world.use_sun_shadow = SUN_THRESHOLD, True
    for column, node in enumerate([*place.values(), background, output]):
        node.location = (200 * column, 0)
    return world


def node(world, kind):
    return next(node for node in world.node_tree.nodes if node.bl_idname == f"ShaderNode{kind}")


def images(world):
    """The panorama of a world, if it has one."""
    return {node.image for node in world.node_tree.nodes if node.type == "TEX_ENVIRONMENT" and node.image}


def light_object(collection, target):
    """Lights the scene by the panorama at an object. Returns warnings."""
    messages = light_place(collection, estimated(collection), centre(target), target.name)
    collection.room_light.target = target
    return messages


def light_view(collection):
    """Lights the scene by the panorama above the middle of the photo's lower part."""
    room = collection.room_light
    width, height = room.photo.size
    scene = estimated(collection)
    try:
        position, _ = scene.surface_at_pixel((width / 2, 0.8 * height))
    except lightoctree.LightOctreeError:
        position = (0.0, -0.5, -1.5)
    up = scene.up or (0.0, 1.0, 0.0)
    place = Vector(position) + ABOVE_M * Vector(up)
    return light_place(collection, scene, room.root.matrix_world @ place, collection.name)


def estimated(collection):
    """Returns the estimated scene of a room."""
    return lightoctree.Scene.from_bytes(collection[SCENE])


def light_place(collection, scene, position, name):
    """Lights the scene by the panorama at a position in world space. Returns warnings."""
    room = collection.room_light
    at = room.root.matrix_world.inverted() @ position
    with warnings.catch_warnings(record=True) as found:
        warnings.simplefilter("always", lightoctree.LightOctreeWarning)
        panorama = scene.environment(tuple(at), (WIDTH, WIDTH // 2), light=room.inferred)
    set_image(room.world, f"Light of {name}", panorama)
    orient(room)
    room.source = "ENVIRONMENT"
    return [str(warning.message) for warning in found]


def orient(room):
    """Turns the panorama with the room."""
    rotation = room.root.matrix_world.to_3x3().normalized().inverted()
    node(room.world, "Mapping").inputs["Rotation"].default_value = (UPRIGHT @ rotation).to_euler("XYZ")


def set_image(world, name, panorama):
    """Sets the pixels of a world's panorama."""
    texture = node(world, "TexEnvironment")
    height, width = panorama.shape[:2]
    if texture.image is None:
        texture.image = bpy.data.images.new(name, width, height, alpha=False, float_buffer=True)
        texture.image.colorspace_settings.name = "Linear Rec.709"
    texture.image.name = name
    # Ours has −Z in its centre, Blender's +X a quarter to the right of +Y; Blender's lowest row is its first.
    turned = np.roll(panorama, -width // 4, axis=1)[::-1]
    pixels = np.ones((height, width, 4), dtype=np.float32)
    pixels[..., :3] = turned
    texture.image.pixels.foreach_set(pixels.ravel())
    texture.image.update()
    texture.image.pack()


def centre(target):
    """The centre of an object's bounds with all its children, in world space."""
    corners = [
        thing.matrix_world @ Vector(corner)
        for thing in [target, *target.children_recursive]
        if thing.type in {"MESH", "CURVE", "SURFACE", "META", "FONT", "CURVES"}
        for corner in thing.bound_box
    ]
    if not corners:
        return target.matrix_world.translation.copy()
    return Vector([(min(c[i] for c in corners) + max(c[i] for c in corners)) / 2 for i in range(3)])


def show_source(collection):
    """Shows what lights the objects, and hides the other."""
    room = collection.room_light
    by_room = room.source == "ROOM"
    for thing in list(collection.all_objects):
        if thing.get(ROLE) in ("Room", "Photo", "Lamp"):
            thing.hide_render = thing.hide_viewport = not by_room
    node(room.world, "Background").inputs["Strength"].default_value = 0.0 if by_room else 1.0
