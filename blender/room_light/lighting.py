"""What lights the objects: the room's surfaces and lamps, or the panorama at one object."""

import warnings

import bpy
import lightoctree
import numpy as np
from mathutils import Matrix, Vector

from .names import MADE, ROLE, ROOM, SCENE, is_shared, part, photo

# Height of the default place above its surface.
ABOVE_M = 0.15
# Twice the photo's white: lamps and windows.
SUN_THRESHOLD = 2.0
# Width of a panorama in pixels; the height is half of it.
WIDTH = 1024
# A world's nodes, from the first to the last.
NODES = ("TexCoord", "Mapping", "TexEnvironment", "Background", "OutputWorld")
# From the camera's frame, +Y up and −Z ahead, to that of Blender's environments, +Z up and +Y ahead.
UPRIGHT = Matrix(((1.0, 0.0, 0.0), (0.0, 0.0, -1.0), (0.0, 1.0, 0.0)))


def world_of(collection):
    """Returns a room's world, which is made if necessary."""
    room = collection.room_light
    if room.world is not None and is_shared(collection, "world"):
        room.world = room.world.copy()
    if room.world is None:
        room.world = bpy.data.worlds.new(f"{collection.name} Environment")
        room.world[MADE] = ROOM
    if not all(node(room.world, kind) for kind in NODES):
        fill_world(room.world)
        set_strength(room)
    return room.world


def fill_world(world):
    """Makes a world's nodes."""
    if not world.use_nodes:
        world.use_nodes = True
    tree = world.node_tree
    tree.nodes.clear()
    coordinates, mapping, panorama, background, output = nodes = [tree.nodes.new(f"ShaderNode{kind}") for kind in NODES]
    tree.links.new(coordinates.outputs["Generated"], mapping.inputs["Vector"])
    tree.links.new(mapping.outputs["Vector"], panorama.inputs["Vector"])
    tree.links.new(panorama.outputs["Color"], background.inputs["Color"])
    tree.links.new(background.outputs["Background"], output.inputs["Surface"])
    # Of EEVEE, which makes a sun of all brighter light.
    world.sun_threshold, world.use_sun_shadow = SUN_THRESHOLD, True
    for column, placed in enumerate(nodes):
        placed.location = (200 * column, 0)


def node(world, kind):
    """Returns a world's node of a kind, or None."""
    tree = world.node_tree
    found = (node for node in tree.nodes if node.bl_idname == f"ShaderNode{kind}") if tree else iter(())
    return next(found, None)


def light_object(collection, target):
    """Lights the scene by the panorama at an object. Returns warnings."""
    messages = light_place(collection, estimated(collection), centre(target), target.name)
    collection.room_light.target = target
    return messages


def light_view(collection):
    """Lights the scene by the panorama above the middle of the photo's lower part."""
    width, height = photo(collection).size
    scene = estimated(collection)
    try:
        position, _ = scene.surface_at_pixel((width / 2, 0.8 * height))
    except lightoctree.LightOctreeError:
        position = (0.0, -0.5, -1.5)
    up = scene.up or (0.0, 1.0, 0.0)
    place = Vector(position) + ABOVE_M * Vector(up)
    return light_place(collection, scene, part(collection, "World").matrix_world @ place, collection.name)


def estimated(collection):
    """Returns the estimated scene of a room."""
    return lightoctree.Scene.from_bytes(collection[SCENE])


def light_place(collection, scene, position, name):
    """Lights the scene by the panorama at a position in world space. Returns warnings."""
    room = collection.room_light
    at = part(collection, "World").matrix_world.inverted() @ position
    with warnings.catch_warnings(record=True) as found:
        warnings.simplefilter("always", lightoctree.LightOctreeWarning)
        panorama = scene.environment(tuple(at), (WIDTH, WIDTH // 2), light=room.inferred)
    set_image(world_of(collection), f"Light of {name}", panorama)
    orient(collection)
    room.source = "ENVIRONMENT"
    return [str(warning.message) for warning in found]


def orient(collection):
    """Turns the panorama with the room."""
    rotation = part(collection, "World").matrix_world.to_3x3().normalized().inverted()
    mapping = node(world_of(collection), "Mapping")
    mapping.inputs["Rotation"].default_value = (UPRIGHT @ rotation).to_euler("XYZ")


def set_image(world, name, panorama):
    """Gives a world a panorama. The image is new, so that undo brings the former one back."""
    texture = node(world, "TexEnvironment")
    former = texture.image
    height, width = panorama.shape[:2]
    image = bpy.data.images.new(name, width, height, alpha=False, float_buffer=True)
    image[MADE] = ROOM
    image.colorspace_settings.name = "Linear Rec.709"
    # Ours has −Z in its centre, Blender's +X a quarter to the right of +Y; Blender's lowest row is its first.
    turned = np.roll(panorama, -width // 4, axis=1)[::-1]
    pixels = np.ones((height, width, 4), dtype=np.float32)
    pixels[..., :3] = turned
    image.pixels.foreach_set(pixels.ravel())
    image.update()
    image.pack()
    texture.image = image
    if former is not None and former.users == 0:
        bpy.data.images.remove(former)
    # Without the suffix that the former one made necessary.
    image.name = name


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
    world_of(collection)
    set_strength(room)


def set_strength(room):
    """Makes a room's world black while the room lights: light would get through its gaps."""
    node(room.world, "Background").inputs["Strength"].default_value = 0.0 if room.source == "ROOM" else 1.0
