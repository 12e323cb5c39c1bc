"""Glass of `insert` beside the same glass rendered by Mitsuba, under one map.

    python checks/glass.py target/release/lightoctree PANORAMA.hdr [FOLDER] [--samples N]

The photo is a view of the map, with a depth of 60 m everywhere, so that what glass shows of the photo is what Mitsuba shows of the
map. Mitsuba's rough glass scatters once and loses up to a sixth of the light; it is divided by what a uniform map gives. Prints for each object the ratio of the mean radiance over its pixels (red, green, blue), the mean relative error of blocks of
8 x 8 pixels, and by how many pixels the refracted picture must be shifted to fit best. Pictures are left in FOLDER. Needs
`pip install mitsuba numpy pillow OpenEXR`.
"""

import argparse
import json
import os
import subprocess
import tempfile

import mitsuba as mi
import numpy as np
import OpenEXR
from PIL import Image

WIDTH, HEIGHT, HFOV = 480, 360, 60.0
DEPTH_M = 60.0
PLACE = np.array([0.02, -0.1, -0.9])
BLOCK = 8
TINT, TINT_M = [0.2, 0.7, 0.3], 0.3


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("program")
    parser.add_argument("panorama")
    parser.add_argument("folder", nargs="?", default=tempfile.mkdtemp())
    parser.add_argument("--samples", type=int, default=256)
    arguments = parser.parse_args()
    mi.set_variant("scalar_rgb")
    os.makedirs(arguments.folder, exist_ok=True)
    place = lambda name: os.path.join(arguments.folder, name)

    panorama = np.minimum(np.array(mi.Bitmap(arguments.panorama).convert(mi.Bitmap.PixelFormat.RGB, mi.Struct.Type.Float32)), 200.0)
    write_exr(place("map.exr"), panorama)
    photo = np.array(mi.render(mi.load_dict(scene(panorama, None)), spp=16))
    write_exr(place("photo.exr"), photo)
    np.save(place("depth.npy"), np.full((HEIGHT, WIDTH), DEPTH_M, np.float32))
    run(arguments.program, "estimate", place("photo.exr"), "--depth", place("depth.npy"), "--hfov-deg", str(HFOV), "-o", place("map.scene"), "--force")

    sphere = write_obj(place("sphere.obj"), circle(0.15, 96))
    wine_glass = write_obj(place("wine_glass.obj"), WINE_GLASS)
    glass = {"preset": "glass", "ior": 1.5}
    tinted = {**glass, "attenuation_color": TINT, "attenuation_distance_m": TINT_M}
    clear = {"type": "dielectric", "int_ior": 1.5}
    rough = {"type": "roughdielectric", "distribution": "ggx", "alpha": 0.35**2, "int_ior": 1.5}
    medium = {"type": "homogeneous", "albedo": 0.0, "scale": 100.0, "sigma_t": {"type": "rgb", "value": [float(-np.log(c) / TINT_M / 100) for c in TINT]}}
    cases = [
        ("sphere", sphere, glass, clear, None),
        ("frosted sphere", sphere, {**glass, "roughness": 0.35}, rough, None),
        ("tinted sphere", sphere, tinted, clear, medium),
        ("wine glass", wine_glass, glass, clear, None),
    ]
    print("object           ratio of means         error of blocks   shift, pixels")
    for name, mesh, material, bsdf, interior in cases:
        ours_file = place(name.replace(" ", "_") + "_ours.exr")
        run(
            arguments.program, "insert", place("map.scene"), "--lighting", f"envmap:{place('map.exr')}", "--lighting-level", "file",
            "--mesh", mesh, "--material", json.dumps(material), "--at", ",".join(str(c) for c in PLACE), "--align", "none",
            "--quality", "high", "--match-look", "off", "-o", ours_file, "--force",
        )  # fmt: skip
        ours = read_exr(ours_file)
        theirs = np.array(mi.render(mi.load_dict(scene(panorama, (mesh, bsdf, interior))), spp=arguments.samples))
        if bsdf["type"] == "roughdielectric":
            kept = np.array(mi.render(mi.load_dict(scene(np.ones_like(panorama), (mesh, bsdf, None))), spp=arguments.samples))
            theirs /= np.maximum(kept, 0.1)
        show(place(name.replace(" ", "_") + ".png"), ours, theirs)
        mask = np.array(mi.render(mi.load_dict(scene(panorama, (mesh, {"type": "diffuse", "reflectance": 0.0}, None))), spp=16)).max(-1) == 0
        compare(name, ours, theirs, mask)
    print(arguments.folder)


def compare(name, ours, theirs, mask):
    ratio = ours[mask].mean(0) / theirs[mask].mean(0)
    rows, columns = HEIGHT // BLOCK, WIDTH // BLOCK
    blocks = lambda image: image[: rows * BLOCK, : columns * BLOCK].reshape(rows, BLOCK, columns, BLOCK, -1).mean((1, 3))
    inside = blocks(mask[..., None].astype(float))[..., 0] == 1
    a, b = blocks(ours)[inside], blocks(theirs)[inside]
    error = np.abs(a - b).sum(1) / b.sum(1)
    grey = lambda image: np.log(image.mean(-1) + 1e-2)
    best = min(
        ((dx, dy) for dx in range(-4, 5) for dy in range(-4, 5)),
        key=lambda by: np.abs(np.roll(grey(ours), by, (1, 0)) - grey(theirs))[mask].mean(),
    )
    print(f"{name:16} {ratio[0]:.3f} {ratio[1]:.3f} {ratio[2]:.3f}       median {np.median(error):.3f}, 90 % {np.quantile(error, 0.9):.3f}   {best}")


def scene(panorama, thing):
    """Mitsuba's scene: its first column of the map looks along -Z, ours the middle one."""
    turned = np.ascontiguousarray(np.roll(panorama, panorama.shape[1] // 2, 1))
    parts = {
        "type": "scene",
        "integrator": {"type": "volpath" if thing and thing[2] else "path", "max_depth": 24},
        "sensor": {
            "type": "perspective", "fov": HFOV, "fov_axis": "x",
            "to_world": mi.ScalarTransform4f().look_at([0, 0, 0], [0, 0, -1], [0, 1, 0]),
            "film": {"type": "hdrfilm", "width": WIDTH, "height": HEIGHT, "rfilter": {"type": "box"}},
        },
        "map": {"type": "envmap", "bitmap": mi.Bitmap(turned)},
    }  # fmt: skip
    if thing:
        mesh, bsdf, interior = thing
        parts["thing"] = {"type": "obj", "filename": mesh, "bsdf": bsdf, "to_world": mi.ScalarTransform4f().translate(PLACE.tolist())}
        if interior:
            parts["thing"]["interior"] = interior
    return parts


# Radius and height in metres, counter-clockwise.
WINE_GLASS = [
    [0.0, 0.0], [0.07, 0.0], [0.07, 0.004], [0.02, 0.012], [0.009, 0.03], [0.009, 0.12], [0.02, 0.135], [0.05, 0.16], [0.068, 0.19], [0.072, 0.22],
    [0.068, 0.27], [0.062, 0.3], [0.059, 0.3], [0.065, 0.27], [0.069, 0.22], [0.065, 0.191], [0.048, 0.163], [0.02, 0.142], [0.0, 0.137],
]  # fmt: skip


def circle(radius, steps):
    angles = np.pi * np.arange(steps + 1) / steps
    return [[max(radius * np.sin(a), 0.0) if 0 < i < steps else 0.0, radius - radius * np.cos(a)] for i, a in enumerate(angles)]


def write_obj(path, profile, segments=192):
    """A closed body of revolution with smooth normals, as both programs then read."""
    points, normals, faces, rings = [], [], [], []
    for i, (radius, height) in enumerate(profile):
        before, after = np.array(profile[max(i - 1, 0)]), np.array(profile[min(i + 1, len(profile) - 1)])
        along = after - before
        n = np.array([along[1], -along[0]]) / np.hypot(*along)
        if radius == 0:
            n = np.array([0.0, np.sign(n[1]) or 1.0])
        rings.append((len(points), 1 if radius == 0 else segments))
        for k in range(rings[-1][1]):
            c, s = np.cos(2 * np.pi * k / segments), np.sin(2 * np.pi * k / segments)
            points.append([radius * c, height, radius * s])
            normals.append([n[0] * c, n[1], n[0] * s])
    for (a, na), (b, nb) in zip(rings, rings[1:]):
        for k in range(segments):
            a0, a1 = a + k % na, a + (k + 1) % na
            b0, b1 = b + k % nb, b + (k + 1) % nb
            faces += [[a0, b0, a1]] * (na > 1) + [[a1, b0, b1]] * (nb > 1)
    with open(path, "w") as file:
        file.writelines(f"v {x:.7f} {y:.7f} {z:.7f}\n" for x, y, z in points)
        file.writelines(f"vn {x:.6f} {y:.6f} {z:.6f}\n" for x, y, z in normals)
        file.writelines("f " + " ".join(f"{v + 1}//{v + 1}" for v in face) + "\n" for face in faces)
    return path


def show(path, ours, theirs):
    both = np.concatenate([ours, theirs], 1)
    both = both / np.quantile(theirs, 0.95)
    Image.fromarray((np.clip(both, 0, 1) ** (1 / 2.2) * 255).astype(np.uint8)).save(path)


def write_exr(path, image):
    OpenEXR.File({}, {"RGB": np.ascontiguousarray(image, np.float32)}).write(path)


def read_exr(path):
    channels = OpenEXR.File(path).channels()
    return np.asarray(channels["RGB"].pixels if "RGB" in channels else np.stack([channels[c].pixels for c in "RGB"], -1))[..., :3].astype(np.float32)


def run(*command):
    subprocess.run([*command, "--quiet"], check=True, stdout=subprocess.DEVNULL)


main()
