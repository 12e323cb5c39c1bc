"""The gallery's sheets of real photos: photo, depth, panorama above the spheres, and a mirror and a matte sphere in the photo.

    python3 scripts/real_photos.py target/release/lightoctree ../shared/data docs/images

Needs Python's numpy, pillow and safetensors. Each photo is estimated alone: no depth, no EXIF but the photo's own. Writes real_photos_1.jpg and
real_photos_2.jpg, five photos each, from top to bottom as PHOTOS has them.
"""

import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw
from safetensors.numpy import load_file

# File, where the spheres stand (shares of width and height), and their height in shares of their distance.
PHOTOS = [
    ("rgbd/library_color.jpg", (0.46, 0.76), (0.62, 0.80), 0.16),
    ("photos_more/desk_devices.jpg", (0.28, 0.84), (0.42, 0.83), 0.16),
    ("photos_more/museum_whale.jpg", (0.50, 0.90), (0.62, 0.90), 0.12),
    ("rgbd_more/tum_fr3_cabinet_02_color.jpg", (0.20, 0.76), (0.34, 0.84), 0.16),
    ("rgbd_more/tum_fr2_hall_01_color.jpg", (0.12, 0.62), (0.28, 0.66), 0.12),
    ("rgbd_more/tum_fr2_desk_color.png", (0.20, 0.70), (0.35, 0.74), 0.14),
    ("rgbd_more/ycbv_tablet_chair_color.png", (0.12, 0.70), (0.26, 0.86), 0.16),
    ("rgbd/tum_desk_color.png", (0.46, 0.90), (0.60, 0.90), 0.12),
    ("rgbd_more/tum_fr1_office_01_color.jpg", (0.56, 0.66), (0.66, 0.80), 0.12),
    ("photos_more/museum_court.jpg", (0.25, 0.92), (0.42, 0.94), 0.14),
]
HEIGHT = 240


def run(*command):
    subprocess.run([str(part) for part in command], check=True, stdout=subprocess.DEVNULL)


def fitted(picture, height=HEIGHT):
    """As wide as it comes to be at this height."""
    return picture.convert("RGB").resize((round(picture.width * height / picture.height), height), Image.Resampling.LANCZOS)


def depth_picture(depth_m):
    """Near is yellow, far is blue, on a logarithmic scale between the 2nd and the 98th percentile, which stand in the corners."""
    near, far = np.percentile(depth_m, [2, 98])
    x = np.clip(np.log(depth_m / near) / np.log(max(far / near, 1.01)), 0, 1)[..., None]
    stops = np.array([[253, 231, 37], [94, 201, 98], [33, 145, 140], [59, 82, 139], [68, 1, 84]], float)
    below = np.minimum((x * 4).astype(int), 3)
    colour = stops[below[..., 0]] + (x * 4 - below) * (stops[below[..., 0] + 1] - stops[below[..., 0]])
    picture = fitted(Image.fromarray(colour.astype(np.uint8)))
    draw = ImageDraw.Draw(picture)
    for text, at in ((f"{near:.2f} m", 6), (f"{far:.2f} m", picture.width - 60)):
        draw.text((at, HEIGHT - 18), text, fill="white", stroke_width=2, stroke_fill="black")
    return picture


def row(program, photo, places, share, work):
    scene = work / "room.scene"
    run(program, "estimate", photo, "-o", scene, "--force", "--quiet")
    size = Image.open(photo).size
    depth_m = load_file(scene)["depth_m"]
    pixels = [(round(x * size[0]), round(y * size[1])) for x, y in places]
    nearest = [depth_m[int(y * depth_m.shape[0]), int(x * depth_m.shape[1])] for x, y in places]
    at = ",".join(map(str, pixels[0]))
    run(program, "envmap", scene, "--pixel", at, "--lift", f"{share * nearest[0]:.3f}", "--level", "-o", work / "light.exr", "--preview", "--force", "--quiet")
    spheres = [
        argument
        for (x, y), z, material in zip(pixels, nearest, ("chrome", "matte-grey"))
        for argument in ("--mesh", "builtin:sphere", "--pixel", f"{x},{y}", "--height", f"{share * z:.3f}", "--material", material)
    ]
    run(program, "insert", scene, *spheres, "-o", work / "composite.png", "--force", "--quiet")
    light = Image.open(next(work.glob("light*.png")))
    return [fitted(Image.open(photo)), depth_picture(depth_m), fitted(light, HEIGHT * 3 // 4), fitted(Image.open(work / "composite.png"))]


def sheet(rows):
    widths = [max(picture.width for picture in column) for column in zip(*rows)]
    gap = 6
    whole = Image.new("RGB", (sum(widths) + gap * 3, len(rows) * (HEIGHT + gap) - gap), "white")
    for i, pictures in enumerate(rows):
        x = 0
        for picture, width in zip(pictures, widths):
            whole.paste(picture, (x + (width - picture.width) // 2, i * (HEIGHT + gap) + (HEIGHT - picture.height) // 2))
            x += width + gap
    return whole


def main():
    program, data, out = map(Path, sys.argv[1:4])
    with tempfile.TemporaryDirectory() as folder:
        rows = []
        for name, mirror, matte, share in PHOTOS:
            print(name, flush=True)
            rows.append(row(program, data / name, (mirror, matte), share, Path(folder)))
    for i in range(0, len(rows), 5):
        sheet(rows[i : i + 5]).save(out / f"real_photos_{i // 5 + 1}.jpg", quality=82, optimize=True)


if __name__ == "__main__":
    main()
