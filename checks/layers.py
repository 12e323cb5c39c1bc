"""The layers of `insert --layers` put together again by OpenImageIO and, where `bpy` is there, by Blender's compositor.

    python checks/layers.py target/release/lightoctree ROOM.scene [FOLDER]

Checks that the light by kind adds up to the objects, that layers and photo give the composite, that the mattes add up to alpha and
that their manifests name the objects, and prints the largest differences. The scene's photo must be an 8-bit sRGB image without
a distorted lens. Needs `pip install OpenImageIO numpy`, and bpy (checks/README.md) for Blender.
"""

import json
import os
import struct
import subprocess
import sys
import tempfile

import numpy as np
import OpenImageIO as oiio

OBJECTS = ["--mesh", "builtin:tea-set", "--at", "0.1,-0.7,-1.9", "--mesh", "builtin:wine-glass", "--at", "-0.25,-0.7,-1.7",
           "--mesh", "builtin:sphere", "--at", "0.4,-0.7,-2.2", "--material", "gold"]  # fmt: skip
PARTS = ["diffuse", "specular", "transmission", "emission", "edge"]


def main():
    program, scene = sys.argv[1:3]
    folder = sys.argv[3] if len(sys.argv) > 3 else tempfile.mkdtemp()
    os.makedirs(folder, exist_ok=True)
    file = lambda name: os.path.join(folder, name)
    command = [program, "insert", scene, *OBJECTS, "--align", "none", "-o", file("composite.png"), "--layers", file("layers.exr"), "--force", "-q"]
    subprocess.run(command, check=True)
    subprocess.run([program, "insert", scene, "--mesh", "builtin:sphere", "--at", "0,50,50", "--align", "none", "--quality", "draft",
                    "-o", file("photo.png"), "--force", "-q"], check=True)  # fmt: skip
    layers = Layers(file("layers.exr"))
    light = sum(layers.rgb(part) for part in PARTS)
    report("light by kind against object", np.abs(light - layers.rgb("object")).max(), 1e-4)
    composite = recombined(layers, linear(read(file("photo.png"))))
    report("layers and photo against composite, codes", np.abs(codes(composite) - 255 * read(file("composite.png"))).max(), 0.51)
    for kind in ["CryptoObject", "CryptoMaterial"]:
        names, coverage = layers.mattes(kind)
        print(f"{kind}: {', '.join(names)}")
        report(f"{kind} against alpha", np.abs(sum(coverage.values()).clip(0, 1) - layers.channel("object.A")).max(), 1e-4)
        assert all(share.max() > 0.9 for share in coverage.values()), "every name is seen"
    try:
        import bpy
    except ImportError:
        print("without Blender: bpy is not there")
        return
    in_blender = blender(bpy, file("photo.png"), file("layers.exr"), folder)
    report("Blender's compositor against composite, codes", np.abs(codes(in_blender) - 255 * read(file("composite.png"))).max(), 1.01)


def report(what, difference, most):
    print(f"{what}: {difference:.2g}")
    if not difference <= most:
        sys.exit(f"more than {most}")


class Layers:
    def __init__(self, path):
        buffer = oiio.ImageBuf(path)
        self.names = list(buffer.spec().channelnames)
        self.attributes = {attribute.name: attribute.value for attribute in buffer.spec().extra_attribs}
        self.pixels = buffer.get_pixels(oiio.FLOAT)

    def channel(self, name):
        return self.pixels[..., self.names.index(name)]

    def rgb(self, layer):
        if f"{layer}.R" not in self.names:
            return 0.0
        return np.stack([self.channel(f"{layer}.{c}") for c in "RGB"], -1)

    def mattes(self, kind):
        key = next(name for name, value in self.attributes.items() if name.startswith("cryptomatte/") and value == kind)[: -len("/name")]
        manifest = json.loads(self.attributes[f"{key}/manifest"])
        ids = {name: struct.unpack("<f", bytes.fromhex(code)[::-1])[0] for name, code in manifest.items()}
        coverage = {name: 0.0 for name in ids}
        for layer in range(3):
            for which, share in [("R", "G"), ("B", "A")]:
                found, shares = self.channel(f"{kind}{layer:02}.{which}"), self.channel(f"{kind}{layer:02}.{share}")
                for name, code in ids.items():
                    coverage[name] = coverage[name] + np.where(found == np.float32(code), shares, 0.0)
        return list(ids), coverage


def recombined(layers, photo):
    below = photo * layers.rgb("shadow_ratio") + layers.rgb("reflection")
    return below * (1 - layers.channel("object.A")[..., None]) + layers.rgb("object") + layers.rgb("grain")


def blender(bpy, photo, layers, folder):
    """Multiply, over, add: the nodes of docs/layers.md."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    scene.use_nodes = True
    tree = scene.node_tree
    tree.nodes.clear()
    source = tree.nodes.new("CompositorNodeImage")
    source.image = bpy.data.images.load(os.path.abspath(layers))
    plate = tree.nodes.new("CompositorNodeImage")
    plate.image = bpy.data.images.load(os.path.abspath(photo))
    out = {socket.name: socket for socket in source.outputs}
    print("Blender's outputs:", ", ".join(out))

    def mix(kind, a, b):
        node = tree.nodes.new("CompositorNodeMixRGB")
        node.blend_type = kind
        tree.links.new(a, node.inputs[1])
        tree.links.new(b, node.inputs[2])
        return node.outputs[0]

    shadowed = mix("MULTIPLY", plate.outputs["Image"], out["shadow_ratio"])
    over = tree.nodes.new("CompositorNodeAlphaOver")
    tree.links.new(shadowed, over.inputs[1])
    tree.links.new(out["object"], over.inputs[2])
    result = over.outputs[0]
    if "grain" in out:
        result = mix("ADD", result, out["grain"])
    final = tree.nodes.new("CompositorNodeComposite")
    tree.links.new(result, final.inputs[0])
    width, height = plate.image.size
    scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = width, height, 100
    scene.render.image_settings.file_format, scene.render.image_settings.color_depth = "OPEN_EXR", "32"
    scene.render.filepath = os.path.join(folder, "blender.exr")
    scene.camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    scene.collection.objects.link(scene.camera)
    bpy.ops.render.render(write_still=True)
    return oiio.ImageBuf(scene.render.filepath).get_pixels(oiio.FLOAT)[..., :3]


def read(path):
    return oiio.ImageBuf(path).get_pixels(oiio.FLOAT)[..., :3]


def linear(srgb):
    return np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4)


def codes(light):
    light = np.clip(light, 0, 1)
    return 255 * np.where(light <= 0.0031308, light * 12.92, 1.055 * light ** (1 / 2.4) - 0.055)


main()
