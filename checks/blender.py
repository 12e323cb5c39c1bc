"""Does Blender light objects by exported scenes as `lightoctree insert` does?

    python checks/blender.py target/release/lightoctree room.scene [--at X,Y,Z ...] [--work DIR]

Run it by a Python that has `bpy`, numpy and OpenEXR (checks/README.md). The scene is exported as GLB and USD, levelled. Each is
opened in Blender, by itself, and a matte and a mirror ball are lit by its mesh and lamps alone, seen by the photo's camera; no
dome, no world. A third time the dome of a probe at the ball lights it alone. `insert` draws the same balls. Asked: the
matte ball's mean radiance within 15 % in each channel (25 % by the dome), and the mirror's brightest spot where `insert` has it.
"""

import argparse
import contextlib
import functools
import json
import math
import os
import subprocess
import sys
import tempfile

import bpy
import numpy as np
import OpenEXR
from mathutils import Vector

RADIUS_M = 0.14
WIDTH = 960
SAMPLES = 64
# Of insert: more is less noise, not another mean.
QUALITY = "normal"
# A dome knows no distances: near furniture it is farther off than the room.
MATTE_TOLERANCE = {"glb": 0.15, "usda": 0.15, "dome": 0.25}
# Of the ball's radius: a quarter of it is 29 degrees of the mirrored room at the middle.
MIRROR_TOLERANCE = 0.25
# Brightest part of a mirror's picture that is its lamps and windows.
BRIGHTEST = 0.02
# Base colour, metallic and roughness of insert's materials of these names.
MATERIALS = {"matte-white": (0.8, 0.0, 1.0), "mirror": (1.0, 1.0, 0.0)}


def main():
    arguments = parse()
    work = arguments.work or tempfile.mkdtemp(prefix="lightoctree-checks-")
    os.makedirs(work, exist_ok=True)
    run = Program(arguments.program, arguments.scene, work)
    places = arguments.at or [(-0.6, -0.5, -1.8), (0.0, -0.7, -1.6), (0.5, -0.2, -2.0)]
    passed = True
    for kind in ["glb", "usda", "dome"]:
        for place in places:
            centre = np.array(place) + RADIUS_M * run.up
            file = run.export(kind, centre)
            for material in MATERIALS:
                expected, alpha = run.insert(place, material)
                with quiet():
                    found = render(file, kind, centre, material, expected.shape[:2], work)
                error, verdict = compare(kind, material, expected, alpha, found)
                passed &= verdict
                what = f"{material:11} {bpy.app.version_string:7} {kind:4} at {place}"
                print(f"{'pass' if verdict else 'FAIL'}  {what}  {error}", flush=True)
    print("all within bounds" if passed else "some out of bounds")
    sys.exit(0 if passed else 1)


def parse():
    point = lambda text: tuple(float(c) for c in text.split(","))
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("program", help="the lightoctree binary")
    parser.add_argument("scene", help="a scene file that `lightoctree estimate` made")
    parser.add_argument("--at", type=point, action="append", help="where the balls' lowest points are: X,Y,Z in the camera's frame")
    parser.add_argument("--work", help="keep the files here")
    return parser.parse_args()


class Program:
    """Runs the binary on one scene."""

    def __init__(self, program, scene, work):
        self.program, self.scene, self.work = os.path.abspath(program), os.path.abspath(scene), work
        self.up = up(scene)
        self.ball = os.path.join(work, "ball.obj")
        write_ball(self.ball)

    def run(self, *arguments):
        return subprocess.run([self.program, *arguments], check=True, capture_output=True, text=True).stdout

    def export(self, kind, centre):
        suffix = "glb" if kind == "glb" else "usda"
        file = os.path.join(self.work, f"room.{suffix}")
        probe = ["--probe-at=" + ",".join(str(c) for c in centre)] if kind == "dome" else []
        self.run("export", self.scene, "--to", suffix, "--level", *probe, "-o", file, "--force")
        return file

    @functools.cache
    def insert(self, place, material):
        """Radiance and coverage of the ball alone, in the photo's pixels."""
        layers = os.path.join(self.work, "layers.exr")
        at = ",".join(str(c) for c in place)
        out = os.path.join(self.work, "composite.png")
        self.run("insert", self.scene, "--mesh", self.ball, "--material", material, "--at", at, "--quality", QUALITY,
                 "--match-look", "off", "--layers", layers, "-o", out, "--force")
        pixels = channels(layers)["object"]
        return pixels[..., :3], pixels[..., 3]


def up(scene):
    """Against gravity, in the camera's frame: things that `insert` draws stand along it."""
    with open(scene, "rb") as file:
        header = json.loads(file.read(int.from_bytes(file.read(8), "little")))
    room = json.loads(header["__metadata__"]["lightoctree"])["room"]
    return np.array(room["up"] if room else [0.0, 1.0, 0.0])


def channels(file):
    """The pixels of an EXR file's layers, RGBA joined."""
    with OpenEXR.File(file) as read:
        return {name: channel.pixels for part in read.parts for name, channel in part.channels.items()}


def write_ball(path, columns=96, rows=48):
    """A ball that stands on the origin."""
    with open(path, "w", encoding="utf-8") as file:
        for row in range(rows + 1):
            theta = math.pi * row / rows
            for column in range(columns):
                phi = 2 * math.pi * column / columns
                x, y, z = math.sin(theta) * math.cos(phi), math.cos(theta), math.sin(theta) * math.sin(phi)
                file.write(f"v {RADIUS_M * x} {RADIUS_M * (y + 1)} {RADIUS_M * z}\nvn {x} {y} {z}\n")
        for row in range(rows):
            for column in range(columns):
                a, b = row * columns + column, row * columns + (column + 1) % columns
                corners = [a + 1, b + 1, b + columns + 1, a + columns + 1]
                file.write("f " + " ".join(f"{i}//{i}" for i in corners) + "\n")


def render(file, kind, centre, material, size, work):
    """The ball in Blender, as radiance and coverage in the photo's pixels."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    if kind == "dome":
        # A new file of Blender has one; the importer makes the dome of it.
        scene.world = bpy.data.worlds.new("World")
    if kind == "glb":
        bpy.ops.import_scene.gltf(filepath=file)
    else:
        bpy.ops.wm.usd_import(filepath=file)
    x, y, z = centre
    # The importers stand +Y up: glTF's by turning every place, USD's by turning the root.
    place = bpy.data.objects["World"].matrix_world @ Vector((x, -z, y) if kind == "glb" else (x, y, z))
    for thing in scene.objects:
        if thing.type == "MESH":
            # Only what lights the ball; the card with the photo and the shadow catcher are for compositing.
            thing.visible_camera = False
            thing.hide_render = thing.name in ("Backdrop", "ShadowCatcher")
        if thing.type == "CAMERA":
            scene.camera = thing
    bpy.ops.mesh.primitive_uv_sphere_add(segments=96, ring_count=48, radius=RADIUS_M, location=place)
    ball = bpy.context.object
    bpy.ops.object.shade_smooth()
    color, metallic, roughness = MATERIALS[material]
    ball_material = bpy.data.materials.new(material)
    ball_material.use_nodes = True  # Blender 5 always does
    shader = ball_material.node_tree.nodes["Principled BSDF"]
    shader.inputs["Base Color"].default_value = (color, color, color, 1.0)
    shader.inputs["Metallic"].default_value = metallic
    shader.inputs["Roughness"].default_value = roughness
    ball.data.materials.append(ball_material)

    height, width = size
    scene.render.engine = "CYCLES"
    scene.cycles.samples = SAMPLES
    scene.cycles.use_denoising = False
    scene.cycles.use_adaptive_sampling = False
    scene.render.film_transparent = True
    scene.render.threads_mode = "FIXED"
    scene.render.threads = 2
    scene.render.resolution_x, scene.render.resolution_y = WIDTH, round(WIDTH * height / width)
    scene.render.resolution_percentage = 100
    scene.render.image_settings.file_format = "OPEN_EXR"
    scene.render.image_settings.color_mode = "RGBA"
    scene.render.filepath = os.path.join(work, "render.exr")
    frame_ball(scene, ball)
    bpy.ops.render.render(write_still=True)
    return channels(scene.render.filepath)["RGBA"]


def frame_ball(scene, ball):
    """Renders around the ball alone."""
    from bpy_extras.object_utils import world_to_camera_view

    bpy.context.view_layer.update()
    corners = [world_to_camera_view(scene, scene.camera, ball.matrix_world @ v.co) for v in ball.data.vertices]
    scene.render.use_border = True
    scene.render.border_min_x, scene.render.border_max_x = min(c.x for c in corners), max(c.x for c in corners)
    scene.render.border_min_y, scene.render.border_max_y = min(c.y for c in corners), max(c.y for c in corners)


def compare(kind, material, expected, alpha, found):
    """How far the ball is off, in words, and whether that is within bounds."""
    factor = expected.shape[1] // found.shape[1]
    shrink = lambda image: image[: found.shape[0] * factor, : found.shape[1] * factor].reshape(
        found.shape[0], factor, found.shape[1], factor, -1).mean(axis=(1, 3))
    expected, alpha = shrink(expected), shrink(alpha)[..., 0]
    inside = (alpha > 0.999) & (found[..., 3] > 0.999)
    if inside.sum() < 100:
        return f"only {inside.sum()} pixels of the ball are seen", False
    a, b = expected[inside], found[inside][:, :3]
    if material != "mirror":
        ratio = b.mean(axis=0) / a.mean(axis=0)
        rms = np.sqrt(((a - b) ** 2).mean()) / a.mean()
        return f"Blender / insert {np.round(ratio, 3)}, RMS {rms:.3f} of the mean", bool(np.all(np.abs(ratio - 1) < MATTE_TOLERANCE[kind]))
    rows, columns = np.nonzero(inside)
    radius = 0.5 * (columns.max() - columns.min() + 1)
    spot = lambda light: brightest_spot(light.mean(axis=1), rows, columns)
    (ya, xa), (yb, xb) = spot(a), spot(b)
    apart = math.hypot(xa - xb, ya - yb) / radius
    likeness = np.corrcoef(np.log1p(a.mean(axis=1)), np.log1p(b.mean(axis=1)))[0, 1]
    ratio = b.mean(axis=0) / a.mean(axis=0)
    return f"brightest {apart:.2f} radii apart, correlation {likeness:.2f}, means {np.round(ratio, 3)}", apart < MIRROR_TOLERANCE


def brightest_spot(light, rows, columns):
    """Centre of the brightest part."""
    brightest = light >= np.quantile(light, 1 - BRIGHTEST)
    weight = np.minimum(light[brightest], 4 * np.quantile(light, 1 - BRIGHTEST))
    return (rows[brightest] * weight).sum() / weight.sum(), (columns[brightest] * weight).sum() / weight.sum()


@contextlib.contextmanager
def quiet():
    """Blender's own lines go nowhere."""
    sys.stdout.flush()
    kept, nowhere = os.dup(1), os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, 1)
    try:
        yield
    finally:
        sys.stdout.flush()
        os.dup2(kept, 1)
        os.close(kept)
        os.close(nowhere)


if __name__ == "__main__":
    main()
