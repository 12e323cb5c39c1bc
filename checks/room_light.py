"""Does the Blender extension light objects as `insert` does?

    python checks/room_light.py room_light.zip PHOTO [--depth DEPTH] [--at X,Y,Z ...] [--ways WAY ...] [--work DIR]

Run it by a Python that has `bpy`, numpy and OpenEXR (checks/README.md). The extension is installed from its zip and makes the room of
the photo. A matte ball at each place is lit by the room in Cycles, by the environment at it in Cycles, and by the same in EEVEE. The
package inside of the zip inserts the same ball. Asked: the ball's mean radiance within 15 % (room) and 25 % (environment), and its
lit side within 20 degrees of where `insert` has it. The composites are written to DIR.
"""

import argparse
import os
import tempfile

os.environ["BLENDER_USER_RESOURCES"] = tempfile.mkdtemp(prefix="room-light-check-")

import bpy
import numpy as np
import OpenEXR
from bpy_extras.object_utils import world_to_camera_view
from mathutils import Vector

RADIUS_M = 0.14
# A whole fraction of the photo.
SHRINK = 4
# Of the composite in Cycles, of the ball alone, and in EEVEE, which takes minutes without a GPU.
SAMPLES, BALL_SAMPLES, EEVEE_SAMPLES = 24, 64, 8
WAYS = {"room": ("CYCLES", "ROOM"), "environment": ("CYCLES", "ENVIRONMENT"), "eevee": ("EEVEE", "ENVIRONMENT")}
# An environment has no distances: near furniture it is farther off than the room.
TOLERANCE = {"room": 0.15, "environment": 0.25, "eevee": 0.25}
LIT_SIDE_DEG = 20.0


def main():
    point = lambda text: tuple(float(c) for c in text.split(","))
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("zip")
    parser.add_argument("photo")
    parser.add_argument("--depth", default="")
    parser.add_argument("--at", type=point, action="append", help="where the balls' lowest points are: X,Y,Z in the camera's frame")
    parser.add_argument("--ways", nargs="+", choices=WAYS, default=list(WAYS))
    parser.add_argument("--work", default=tempfile.mkdtemp(prefix="room-light-check-"))
    arguments = parser.parse_args()
    work = os.path.abspath(arguments.work)
    os.makedirs(work, exist_ok=True)
    bpy.ops.extensions.package_install_files(
        filepath=os.path.abspath(arguments.zip), repo="user_default", enable_on_install=True)
    passed = True
    for number, at in enumerate(arguments.at or [(-0.6, -0.5, -1.8), (0.0, -0.7, -1.6), (0.5, -0.2, -2.0)]):
        for way in arguments.ways:
            scene, room, ball = make(arguments, way, at)
            found = render(scene, ball, os.path.join(work, "ball.exr"))
            if number == 0:
                composite(scene, os.path.join(work, f"{way}.png"))
            expected = inserted(room, at, os.path.join(work, "insert.png"))
            text, verdict = compare(way, expected, found)
            passed &= verdict
            print(f"{'pass' if verdict else 'FAIL'}  {bpy.app.version_string:10} {way:11} at {at}  {text}", flush=True)
    print("all within bounds" if passed else "some out of bounds")
    raise SystemExit(not passed)


def make(arguments, way, at):
    """The room in a new file, with the ball."""
    engine, source = WAYS[way]
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
    scene = bpy.context.scene
    eevee = "BLENDER_EEVEE" if bpy.app.version >= (5, 0, 0) else "BLENDER_EEVEE_NEXT"
    scene.render.engine = "CYCLES" if engine == "CYCLES" else eevee
    scene.room_light.photo, scene.room_light.depth = os.path.abspath(arguments.photo), arguments.depth
    bpy.ops.room_light.make_room()
    room = scene.room_light.active
    root = bpy.data.objects[f"{room.name} World"]
    up = root.matrix_world.to_3x3().inverted() @ Vector((0, 0, 1))
    centre = root.matrix_world @ (Vector(at) + RADIUS_M * up)
    bpy.ops.mesh.primitive_uv_sphere_add(segments=96, ring_count=48, radius=RADIUS_M, location=centre)
    bpy.ops.object.shade_smooth()
    ball = bpy.context.object
    material = bpy.data.materials.new("matte")
    if not material.use_nodes:
        material.use_nodes = True  # Blender 5 always does
    shader = material.node_tree.nodes["Principled BSDF"]
    shader.inputs["Base Color"].default_value = (0.8, 0.8, 0.8, 1.0)
    shader.inputs["Roughness"].default_value = 1.0
    shader.inputs["Specular IOR Level"].default_value = 0.5
    ball.data.materials.append(material)
    if source == "ENVIRONMENT":
        bpy.ops.room_light.light_object()
    else:
        room.room_light.source = "ROOM"
    scene.render.resolution_percentage = 100 // SHRINK
    scene.eevee.taa_render_samples = EEVEE_SAMPLES
    return scene, room, ball


def render(scene, ball, path):
    """The ball with alpha, before the compositor."""
    scene.render.use_compositing = False
    scene.cycles.samples, scene.cycles.use_denoising, scene.render.use_border = BALL_SAMPLES, False, True
    frame(scene, ball)
    surfaces = [thing for thing in scene.objects if thing.get("room_light_role") == "ShadowCatcher"]
    hidden = scene.render.engine != "CYCLES"
    # EEVEE has no shadow catchers: the ball alone.
    for thing in surfaces:
        thing.hide_render = hidden
    scene.render.image_settings.file_format = "OPEN_EXR"
    scene.render.image_settings.color_mode = "RGBA"
    scene.render.filepath = path
    bpy.ops.render.render(write_still=True)
    for thing in surfaces:
        thing.hide_render = False
    scene.render.use_border = False
    with OpenEXR.File(path) as file:
        return file.channels()["RGBA"].pixels


def frame(scene, ball):
    """Renders around the ball alone."""
    bpy.context.view_layer.update()
    corners = [world_to_camera_view(scene, scene.camera, ball.matrix_world @ Vector(c)) for c in ball.bound_box]
    scene.render.border_min_x, scene.render.border_max_x = min(c.x for c in corners), max(c.x for c in corners)
    scene.render.border_min_y, scene.render.border_max_y = min(c.y for c in corners), max(c.y for c in corners)


def composite(scene, path):
    """The picture that the user gets."""
    scene.cycles.samples, scene.cycles.use_denoising = SAMPLES, True
    scene.render.use_compositing = True
    scene.render.image_settings.file_format = "PNG"
    scene.render.image_settings.color_mode = "RGB"
    scene.render.filepath = path
    bpy.ops.render.render(write_still=True)


def inserted(room, at, path):
    """The ball by `insert`, with alpha."""
    import lightoctree

    scene = lightoctree.Scene.from_bytes(room["room_light_scene"])
    ball = {"mesh": "builtin:sphere", "position_m": list(at), "height_m": 2 * RADIUS_M, "material": "matte-white"}
    made = scene.insert(ball, match_look=False)
    made.save(path)
    return np.dstack([made.layers["object"], made.layers["alpha"]])


def compare(way, expected, found):
    """How far the ball is off, in words, and whether that is within bounds."""
    factor, (rows, columns) = SHRINK, found.shape[:2]
    expected = expected[: rows * factor, : columns * factor].reshape(rows, factor, columns, factor, -1).mean(axis=(1, 3))
    inside = (expected[..., 3] > 0.999) & (found[..., 3] > 0.999)
    if inside.sum() < 100:
        return f"only {inside.sum()} pixels of the ball are seen", False
    a, b = expected[inside][:, :3], found[inside][:, :3]
    ratio = b.mean(axis=0) / a.mean(axis=0)
    rms = np.sqrt(((a - b) ** 2).mean()) / a.mean()
    angle = np.degrees(np.arccos(np.clip(side(a, inside) @ side(b, inside), -1, 1)))
    right = bool(np.all(np.abs(ratio - 1) < TOLERANCE[way]) and angle < LIT_SIDE_DEG)
    return f"Blender / insert {np.round(ratio, 3)}, RMS {rms:.3f}, lit side {angle:.0f} degrees off", right


def side(light, inside):
    """Direction in the picture in which the ball gets brighter."""
    y, x = np.nonzero(inside)
    luminance = light.mean(axis=1)
    slopes, *_ = np.linalg.lstsq(np.stack([x, y, np.ones_like(x)], axis=1), luminance, rcond=None)
    return slopes[:2] / np.linalg.norm(slopes[:2])


if __name__ == "__main__":
    main()
