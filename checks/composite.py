"""An object in the photo, rendered by Blender in an exported room: the steps of docs/blender.md as a script.

    python checks/composite.py room.usda object.glb X,Y,Z picture.png [--height M] [--samples N] [--percent P]

X,Y,Z is where the middle of the object's base stands, in Blender's axes (Z up) of a room exported with --level: the floor is
at Z = 0, the camera above the origin looks along +Y. Beside the picture, picture.exr is the object and its shadow alone, with alpha.
Run it by a Python that has `bpy`, numpy and OpenEXR (checks/README.md).
"""

import argparse
import os

import bpy
import numpy as np
import OpenEXR
from mathutils import Matrix, Vector


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    for name in ["room", "model", "place", "picture"]:
        parser.add_argument(name)
    parser.add_argument("--height", type=float, help="of the object in metres, instead of its own")
    parser.add_argument("--samples", type=int, default=64)
    parser.add_argument("--percent", type=int, default=100, help="of the photo's resolution")
    arguments = parser.parse_args()
    room, picture = arguments.room, arguments.picture
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.wm.usd_import(filepath=room)
    prepare_room()
    stand(arguments.model, Vector(float(c) for c in arguments.place.split(",")), arguments.height)
    layer = os.path.splitext(os.path.abspath(picture))[0] + ".exr"
    photo = bpy.data.images.load(os.path.splitext(os.path.abspath(room))[0] + "_photo.png")
    render(layer, photo.size, arguments)
    put_over(layer, photo, picture)


def prepare_room():
    """What the USD file cannot say: who sees which object."""
    objects = bpy.data.objects
    # Blender draws what a shadow catcher loses when all other objects come: the room belongs to what was there before.
    for name in ["Room", "Photo", "ShadowCatcher"]:
        objects[name].is_shadow_catcher = True
    # The room lights and is mirrored; the picture has the photo in its place.
    for name in ["Room", "Photo"]:
        objects[name].visible_camera = False
    # The grey copy of the photo's mesh only catches shadows.
    catcher = objects["ShadowCatcher"]
    catcher.visible_diffuse = catcher.visible_glossy = catcher.visible_transmission = catcher.visible_shadow = False
    # The photo's card is for programs without a compositor.
    objects["Backdrop"].hide_render = True
    bpy.context.scene.camera = objects["Camera"]
    # Rays find large dim surfaces by themselves; lamps are sampled.
    for name in ["Radiance", "Seen"]:
        bpy.data.materials[name].cycles.emission_sampling = "NONE"


def stand(model, place, height):
    """Imports the object and stands it there."""
    known = set(bpy.data.objects)
    if model.endswith((".glb", ".gltf")):
        bpy.ops.import_scene.gltf(filepath=model)
    else:
        bpy.ops.wm.obj_import(filepath=model)
    new = [thing for thing in bpy.data.objects if thing not in known]
    least, most = bounds(new)
    scale = height / (most.z - least.z) if height else 1.0
    base = Vector(((least.x + most.x) / 2, (least.y + most.y) / 2, least.z))
    for thing in (thing for thing in new if thing.parent is None):
        move = Matrix.Translation(place) @ Matrix.Scale(scale, 4) @ Matrix.Translation(-base)
        thing.matrix_world = move @ thing.matrix_world


def bounds(things):
    """The lowest and the highest corner of all meshes."""
    bpy.context.view_layer.update()
    corners = [thing.matrix_world @ Vector(c) for thing in things if thing.type == "MESH" for c in thing.bound_box]
    return [Vector(pick(c[i] for c in corners) for i in range(3)) for pick in (min, max)]


def render(layer, size, arguments):
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    scene.cycles.samples = arguments.samples
    scene.cycles.use_denoising = True
    scene.render.film_transparent = True
    scene.render.resolution_x, scene.render.resolution_y = size
    scene.render.resolution_percentage = arguments.percent
    scene.render.image_settings.file_format = "OPEN_EXR"
    scene.render.image_settings.color_mode = "RGBA"
    scene.render.filepath = layer
    bpy.ops.render.render(write_still=True)


def put_over(layer, photo, picture):
    """Alpha over the photo, in linear light; 1 is the photo's white, so nothing is tone-mapped."""
    with OpenEXR.File(layer) as file:
        pixels = file.channels()["RGBA"].pixels
    height, width = pixels.shape[:2]
    photo.scale(width, height)
    below = np.array(photo.pixels[:], dtype=np.float32).reshape(height, width, 4)[::-1, :, :3]
    linear = np.where(below <= 0.04045, below / 12.92, ((below + 0.055) / 1.055) ** 2.4)
    over = np.clip(pixels[..., :3] + (1 - pixels[..., 3:]) * linear, 0, 1)
    out = np.ones((height, width, 4), dtype=np.float32)
    out[..., :3] = np.where(over <= 0.0031308, over * 12.92, 1.055 * over ** (1 / 2.4) - 0.055)
    image = bpy.data.images.new("picture", width, height)
    image.pixels = out[::-1].ravel()
    image.file_format = "PNG"
    image.filepath_raw = os.path.abspath(picture)
    image.save()


if __name__ == "__main__":
    main()
