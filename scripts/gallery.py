"""The pictures of README.md, docs/gallery.md, docs/lights.md and docs/web.md that the shipped weights decide about, made anew.

    python3 scripts/gallery.py target/release/lightoctree ../shared/data docs/images [NAME ...]

Needs Python's numpy, pillow, safetensors and opencv-python-headless, and Chromium. NAME is a function below, without them all pictures are made, in about four minutes of
two cores. Scenes are kept in ./out/gallery and made again when the program is newer. Not among them: the page of `view`, Cycles' picture, the mirror ball, generated rooms.
"""

import json
import subprocess
import sys
from pathlib import Path

import cv2
import numpy as np
from PIL import Image, ImageDraw
from safetensors.numpy import load_file

PROGRAM, DATA, OUT = map(Path, sys.argv[1:4])
WORK = Path("out/gallery")
HEIGHT = 240


def run(*command):
    subprocess.run([str(part) for part in command], check=True, stdout=subprocess.DEVNULL)


def scene(name, photo, *options):
    """The scene file of a photo, estimated if it is not there or older than the program."""
    path = WORK / f"{name}.scene"
    if not path.exists() or path.stat().st_mtime < PROGRAM.stat().st_mtime:
        run(PROGRAM, "estimate", photo, *options, "-o", path, "--force", "--quiet")
    return path


def library():
    return scene("library", DATA / "rgbd/library_color.jpg", "--depth", DATA / "rgbd/library_lidar_depth.png", "--intrinsics", "1330,1330,960,720")


def desk():
    options = ("--depth", DATA / "rgbd/tum_desk_depth.png", "--depth-scale", 5000, "--intrinsics", "525,525,319.5,239.5")
    return scene("desk", DATA / "rgbd/tum_desk_color.png", *options)


def library_alone():
    return scene("library_alone", DATA / "rgbd/library_color.jpg")


def desk_alone():
    return scene("desk_alone", DATA / "rgbd/tum_desk_color.png")


def frame(name):
    """A frame of rgbd_more with its measured depth."""
    entry = next(entry for entry in json.loads((DATA / "rgbd_more/frames.json").read_text()) if entry["color"].startswith(name))
    options = ("--depth", DATA / "rgbd_more" / entry["depth"], "--depth-scale", entry["depth_scale"])
    return scene(name, DATA / "rgbd_more" / entry["color"], *options, "--intrinsics", ",".join(map(str, entry["intrinsics"])))


def view(panorama, size, hfov_deg, yaw_deg, pitch_deg, exposure):
    """A photo cut out of a panorama of shared data, as a camera would take it there."""
    radiance = cv2.imread(str(DATA / panorama), cv2.IMREAD_UNCHANGED)
    width, height = size
    focal = width / 2 / np.tan(np.radians(hfov_deg) / 2)
    x, y = np.meshgrid(np.arange(width) + 0.5 - width / 2, height / 2 - np.arange(height) - 0.5)
    ray = np.stack([x, y, np.full_like(x, -focal)], -1)
    ray /= np.linalg.norm(ray, axis=-1, keepdims=True)
    sin, cos = np.sin(np.radians(pitch_deg)), np.cos(np.radians(pitch_deg))
    up, back = cos * ray[..., 1] - sin * ray[..., 2], sin * ray[..., 1] + cos * ray[..., 2]
    azimuth = np.arctan2(ray[..., 0], -back) + np.radians(yaw_deg)
    rows, columns = radiance.shape[:2]
    u = (azimuth / (2 * np.pi) + 0.5) % 1 * columns - 0.5
    v = (0.5 - np.arcsin(up) / np.pi) * rows - 0.5
    linear = exposure * cv2.remap(radiance, np.float32(u), np.float32(v), cv2.INTER_LINEAR, borderMode=cv2.BORDER_WRAP)
    linear = np.clip(linear, 0, 1)
    encoded = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
    path = WORK / f"{Path(panorama).stem}_{yaw_deg}.png"
    cv2.imwrite(str(path), np.uint8(encoded * 255 + 0.5))
    return path


def smaller(photo, longer_side=1280):
    """A copy of a photo of shared data, as it is but for its size."""
    picture = Image.open(DATA / photo)
    share = longer_side / max(picture.size)
    path = WORK / f"small_{Path(photo).name}"
    resized = picture.resize([round(side * share) for side in picture.size], Image.Resampling.LANCZOS)
    resized.save(path, quality=95, exif=picture.getexif())
    return path


def insert(scene, *options):
    path = WORK / "composite.png"
    run(PROGRAM, "insert", scene, *options, "-o", path, "--force", "--quiet")
    return Image.open(path).convert("RGB")


def sphere(pixel, height, material):
    """The options that stand a sphere on what is seen at a pixel."""
    return "--mesh", "builtin:sphere", "--pixel", pixel, "--height", height, "--material", material


def panorama(scene, *options):
    run(PROGRAM, "envmap", scene, *options, "-o", WORK / "light.exr", "--preview", "--force", "--quiet")
    return Image.open(next(WORK.glob("light*.png"))).convert("RGB")


def cut(picture, box, width):
    part = picture.crop(box)
    return part.resize((width, round(part.height * width / part.width)), Image.Resampling.LANCZOS)


def grid(rows, gap=4):
    """Pictures in rows and columns, each in the middle of its place."""
    widths = [max(picture.width for picture in column) for column in zip(*rows)]
    heights = [max(picture.height for picture in row) for row in rows]
    whole = Image.new("RGB", (sum(widths) + gap * (len(widths) - 1), sum(heights) + gap * (len(heights) - 1)), "white")
    y = 0
    for row, height in zip(rows, heights):
        x = 0
        for picture, width in zip(row, widths):
            whole.paste(picture, (x + (width - picture.width) // 2, y + (height - picture.height) // 2))
            x += width + gap
        y += height + gap
    return whole


def save(picture, name):
    picture.save(OUT / f"{name}.jpg", quality=84, optimize=True)


def demo():
    """library_object, library_panorama, materials, moving."""
    folder = WORK / "demo"
    run(PROGRAM, "demo", "--out", folder, "--force", "--quiet")
    save(cut(Image.open(folder / "object_gold.png"), (0, 0, 960, 720), 640), "library_object")
    save(cut(Image.open(folder / "panorama.png"), (0, 0, 512, 256), 640), "library_panorama")
    box = (340, 330, 700, 620)
    save(grid([[cut(Image.open(folder / f"object_{name}.png"), box, 398) for name in ("gold", "chrome", "matte_white")]]), "materials")
    frames = [cut(Image.open(folder / f"moving/frame_{i:02}.jpg"), (0, 240, 960, 720), 347) for i in (0, 4, 7, 11)]
    save(grid([frames]), "moving")


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


def real_photo(name, mirror, matte, share):
    """Photo, depth, panorama above the spheres, and a mirror and a matte sphere in the photo, of which nothing is known but its own EXIF."""
    photo = DATA / name
    file = scene(f"alone_{photo.stem}", photo)
    size = Image.open(photo).size
    depth_m = load_file(file)["depth_m"]
    pixels = [(round(x * size[0]), round(y * size[1])) for x, y in (mirror, matte)]
    nearest = [depth_m[int(y * depth_m.shape[0]), int(x * depth_m.shape[1])] for x, y in (mirror, matte)]
    light = panorama(file, "--pixel", "{},{}".format(*pixels[0]), "--lift", f"{share * nearest[0]:.3f}", "--level")
    pair = [sphere(f"{x},{y}", f"{share * z:.3f}", material) for (x, y), z, material in zip(pixels, nearest, ("chrome", "matte-grey"))]
    return [fitted(Image.open(photo)), depth_picture(depth_m), fitted(light, HEIGHT * 3 // 4), fitted(insert(file, *pair[0], *pair[1]))]


def real_photos():
    rows = [real_photo(*photo) for photo in PHOTOS]
    for i in range(0, len(rows), 5):
        save(grid(rows[i : i + 5], 6), f"real_photos_{i // 5 + 1}")


def spheres():
    def three(file, pixels, height):
        mirror, rough, matte = (sphere(pixel, height, material) for pixel, material in zip(pixels, ("chrome", "rough-silver", "matte-white")))
        return insert(file, *mirror, *rough, *matte, "--quality", "high")

    floor = ("880,1080", "1090,1090", "1300,1105")
    table = ("195,236", "245,233", "295,230")
    rows = [[cut(three(file, floor, 0.28), (640, 820, 1480, 1240), 600) for file in (library(), library_alone())]]
    rows.append([cut(three(file, table, 0.13), (90, 70, 490, 270), 600) for file in (desk(), desk_alone())])
    save(grid(rows), "spheres")


def photo_alone():
    """A photo of which nothing else is known, and objects in it."""
    objects = ("--mesh", "builtin:suzanne", "--height", 0.45, "--pixel", "640,1190", "--yaw-deg", 25, "--material", "plastic-red")
    objects += sphere("1400,1210", 0.42, "chrome")
    objects += ("--mesh", DATA / "meshes/wooden_table_02/wooden_table_02_1k.gltf", "--height", 0.4, "--pixel", "1020,1120", "--yaw-deg", 20)
    photo = Image.open(DATA / "rgbd/library_color.jpg").convert("RGB")
    pictures = (photo, insert(library_alone(), *objects, "--quality", "high"))
    save(grid([[cut(picture, (0, 0, 1920, 1440), 638) for picture in pictures]]), "photo_alone")


def tea_set():
    mesh = DATA / "meshes/tea_set_01/tea_set_01_1k.gltf"
    picture = insert(library(), "--mesh", mesh, "--pixel", "1050,1120", "--quality", "high")
    save(cut(picture, (560, 800, 1540, 1300), 900), "library_tea_set")


def spot():
    mesh = DATA / "meshes/spot/spot_triangulated.obj"
    picture = insert(desk(), "--mesh", mesh, "--height", 0.18, "--pixel", "290,230", "--yaw-deg", 200, "--quality", "high")
    save(cut(picture, (120, 80, 520, 280), 800), "tum_desk_spot")


def several():
    meshes = DATA / "meshes"
    objects = [
        {"mesh": str((meshes / "wooden_table_02/wooden_table_02_1k.gltf").resolve()), "name": "table", "pixel": [1010, 1130], "height_m": 0.45, "yaw_deg": 25},
        {"mesh": str((meshes / "tea_set_01/tea_set_01_1k.gltf").resolve()), "on": "table", "scale": 0.62, "yaw_deg": 25},
        {"mesh": "builtin:sphere", "pixel": [1330, 1250], "height_m": 0.34, "material": "chrome"},
        {"mesh": "builtin:suzanne", "pixel": [640, 1230], "height_m": 0.32, "yaw_deg": 25, "material": "plastic-red"},
    ]
    (WORK / "objects.json").write_text(json.dumps({"objects": objects}))
    pictures = [insert(library(), "--layout", WORK / "objects.json", *options) for options in ((), ("--floor-gloss", 0.7, "--quality", "high"))]
    save(grid([[cut(picture, (420, 640, 1540, 1400), 638) for picture in pictures]]), "several")


def box(name, width, depth):
    """A mesh file of a box of a metre's height, its base in the middle of z = 0 … −depth."""
    corners = [(x, y, z) for z in (0, -depth) for x, y in ((-width / 2, 0), (width / 2, 0), (width / 2, 1), (-width / 2, 1))]
    faces = ("1 2 3 4", "6 5 8 7", "5 1 4 8", "2 6 7 3", "4 3 7 8", "5 6 2 1")
    path = WORK / name
    path.write_text("".join(f"v {x} {y} {z}\n" for x, y, z in corners) + "".join(f"f {face}\n" for face in faces))
    return path


def mattes():
    board = ("--mesh", box("board.obj", 1, 0.02), "--material", "matte-white", "--quality", "draft")
    jug = insert(frame("ycbv_tablet_chair_color"), *board, "--height", 0.4, "--at=0,-0.1,-1.45")
    screen = insert(frame("tum_fr2_desk_color"), *board, "--height", 0.9, "--at=-0.1,-0.25,-2.1")
    save(grid([[cut(jug, (180, 80, 500, 320), 638), cut(screen, (60, 80, 380, 320), 638)]]), "mattes")


def desk_panorama():
    save(panorama(desk(), "--at", "0,0,-1.7", "--size", "800x400"), "tum_desk_panorama")


def chrome_lookup():
    panel = ("--mesh", box("panel.obj", 0.03, 1), "--material", "chrome", "--height", 1.1, "--pixel", "1120,960", "--yaw-deg", 22)
    parts = [(panel, (960, 440, 1300, 1080)), (sphere("950,1000", 1.0, "chrome"), (600, 440, 1240, 1080))]
    pictures = [insert(library(), *options, "--quality", quality).crop(box) for options, box in parts for quality in ("draft", "normal")]
    save(grid([[fitted(picture, 420) for picture in pictures]]), "chrome_lookup")


def networks():
    """Panoramas 1 m, 1.7 m and 0.6 m before the camera: measured depth and photo alone."""
    files = (library(), library_alone(), desk(), desk_alone())
    save(grid([[panorama(file, f"--at=0,0,-{z}", "--size", "398x199") for z in ("1", "1.7", "0.6")] for file in files], 3), "networks")


def shadows():
    picture = insert(library(), *sphere("600,900", 0.8, "matte-white"))
    save(cut(picture, (150, 640, 950, 1200), 800), "shadows")


def panorama_prior():
    photo = view("hdr/brown_photostudio_07_1k.hdr", (1000, 750), 70, -159, -18, 1.0)
    alone = scene("studio_alone", photo, "--hfov-deg", 70)
    known = scene("studio", photo, "--hfov-deg", 70, "--panorama", DATA / "hdr/brown_photostudio_07_1k.hdr")
    pictures = (insert(file, *sphere("300,440", 0.4, "chrome")) for file in (alone, known))
    save(grid([[cut(picture, (0, 0, 1000, 750), 579) for picture in pictures]], 2), "panorama_prior")


def lights():
    """lights_object: a sun and a warm lamp added to the library. lights_panorama: the office with its light changed."""
    sun, area = WORK / "sun.scene", WORK / "area.scene"
    run(PROGRAM, "lights", "add", "sun", library(), "--azimuth", 120, "--elevation", 40, "--strength", 3, "--color", "5000K", "-o", sun, "--force", "--quiet")
    at = ("--at", "-0.6,0.2,-2.2", "--direction", "0.4,-1,-0.2", "--size", "0.4,0.4", "--radiance", 25, "--color", "2700K")
    run(PROGRAM, "lights", "add", "area", library(), *at, "-o", area, "--force", "--quiet")
    suzanne = ("--mesh", DATA / "meshes/suzanne.glb", "--height", 0.5, "--pixel", "1050,1120")
    save(grid([[cut(insert(file, *suzanne), (650, 700, 1450, 1340), 397) for file in (library(), sun, area)]], 4), "lights_object")
    office = frame("tum_fr1_office_04_color")
    changed = [office]
    for name, change in (("off", ("--off",)), ("warm", ("--scale", 2, "--color", "2700K"))):
        changed.append(WORK / f"office_{name}.scene")
        run(PROGRAM, "lights", "set", office, "L1", *change, "-o", changed[-1], "--force", "--quiet")
    parts = [panorama(file, "--at=0,0,-1", "--size", "1024x512").crop((312, 100, 712, 283)) for file in changed]
    save(grid([parts]), "lights_panorama")


# Photo, its lens where it is not told, where the white ball, the chrome ball and the tea set stand (shares of width and height), and the balls' height in
# shares of their distance.
TWELVE = [
    (lambda: smaller("rgbd/library_color.jpg"), None, (0.40, 0.80), (0.54, 0.86), (0.74, 0.82), 0.14),
    (lambda: DATA / "rgbd/tum_desk_color.png", None, (0.33, 0.51), (0.45, 0.53), (0.66, 0.57), 0.10),
    (lambda: smaller("photos_more/desk_devices.jpg"), None, (0.28, 0.84), (0.42, 0.83), (0.70, 0.88), 0.14),
    (lambda: smaller("photos_more/museum_court.jpg"), None, (0.20, 0.96), (0.80, 0.96), (0.62, 0.94), 0.06),
    (lambda: smaller("photos_more/museum_whale.jpg"), None, (0.50, 0.90), (0.62, 0.90), (0.78, 0.93), 0.10),
    (lambda: smaller("photos_more/parquet_pc.jpg"), None, (0.78, 0.92), (0.91, 0.84), (0.60, 0.95), 0.10),
    (lambda: DATA / "rgbd_more/tum_fr2_hall_01_color.jpg", None, (0.50, 0.93), (0.62, 0.94), (0.35, 0.90), 0.10),
    (lambda: DATA / "rgbd_more/tum_fr3_cabinet_01_color.jpg", None, (0.20, 0.70), (0.34, 0.90), (0.72, 0.86), 0.12),
    (lambda: view("hdr/lebombo_1k.hdr", (960, 640), 75, 90, -14, 0.35), 75, (0.40, 0.86), (0.56, 0.90), (0.76, 0.92), 0.12),
    (lambda: view("hdr/brown_photostudio_02_1k.hdr", (960, 640), 75, -90, -14, 0.8), 75, (0.40, 0.82), (0.54, 0.90), (0.26, 0.92), 0.12),
    (lambda: view("hdr/st_fagans_interior_1k.hdr", (960, 640), 75, 90, -12, 0.55), 75, (0.30, 0.80), (0.46, 0.86), (0.66, 0.90), 0.10),
    (lambda: view("hdr/autoshop_01_1k.hdr", (960, 640), 75, -90, -12, 0.9), 75, (0.34, 0.82), (0.48, 0.88), (0.66, 0.88), 0.10),
]


def sheet():
    """Twelve photos of which nothing else is known: objects under even light, and under plausible light."""
    pictures = []
    for make, hfov_deg, *places, share in TWELVE:
        photo = make()
        file = scene(f"sheet_{photo.stem}", photo, *(("--hfov-deg", hfov_deg) if hfov_deg else ()))
        width, height = Image.open(photo).size
        depth_m = load_file(file)["depth_m"]
        sizes = [share * depth_m[int(y * depth_m.shape[0]), int(x * depth_m.shape[1])] for x, y in places]
        white, chrome, set_ = (f"{round(x * width)},{round(y * height)}" for x, y in places)
        objects = (*sphere(white, f"{sizes[0]:.3f}", "matte-white"), *sphere(chrome, f"{sizes[1]:.3f}", "chrome"))
        objects += ("--mesh", DATA / "meshes/tea_set_01/tea_set_01_1k.gltf", "--pixel", set_, "--height", f"{sizes[2] * 0.6:.3f}", "--yaw-deg", 30)
        pictures.append([fitted(insert(file, *objects, "--light", light), 360) for light in ("even", "plausible")])
    save(grid([pictures[i] + pictures[i + 1] for i in range(0, 12, 2)]), "sheet")


def sunny():
    photo = view("hdr/lebombo_1k.hdr", (960, 640), 80, 80, -20, 0.266)
    file = scene("sunny", photo)
    lit = WORK / "sunny_lit.scene"
    run(PROGRAM, "lights", "add", "sun", file, "--azimuth", -109, "--elevation", 44, "-o", lit, "--force", "--quiet")
    mesh = ("--mesh", DATA / "meshes/suzanne.glb", "--height", 0.3, "--pixel", "640,560", "--yaw-deg", 20)
    near, far = (("--mesh", "builtin:sphere", "--height", 0.22, "--pixel", pixel) for pixel in ("330,560", "760,480"))
    options = (*mesh, *near, *far, "--quality", "high")
    save(grid([[cut(insert(file, *options), (120, 180, 960, 640), 678) for file in (file, lit)]]), "sun_patches")


def window():
    photo = view("hdr/brown_photostudio_02_1k.hdr", (1000, 750), 85, 112, -20, 1.3)
    mesh = ("--mesh", DATA / "meshes/spot/spot_triangulated.obj", "--height", 0.35, "--pixel", "700,660", "--material", "matte-white", "--yaw-deg", 150)
    picture = insert(scene("window", photo), *sphere("420,640", 0.35, "matte-white"), *mesh, "--quality", "high")
    save(grid([[cut(picture, (0, 0, 1000, 750), 638) for picture in (Image.open(photo).convert("RGB"), picture)]]), "window")


def lamp():
    photo = view("hdr_more/ferndale_studio_07.hdr", (900, 675), 105, 125, -14, 1.2)
    file = scene("lamp", photo)
    mesh = ("--mesh", DATA / "meshes/spot/spot_triangulated.obj", "--height", 0.3, "--pixel", "600,560", "--material", "matte-white", "--yaw-deg", 150)
    options = (*sphere("260,540", 0.3, "matte-white"), *mesh, "--quality", "high")
    pictures = (Image.open(photo).convert("RGB"), insert(file, "--no-lamp", *options), insert(file, *options))
    save(grid([[cut(picture, (100, 100, 800, 660), 424) for picture in pictures]]), "lamp")


def glass():
    on_floor = [("glass-sphere", 0.3, "900,1180", ()), ("wine-glass", 0.4, "1150,1150", ()), ("bottle", 0.5, "1380,1120", ()),
                ("sphere", 0.3, "650,1150", ("--material", "frosted-glass"))]  # fmt: skip
    objects = [option for name, height, pixel, more in on_floor for option in ("--mesh", f"builtin:{name}", "--height", height, "--pixel", pixel, *more)]
    save(cut(insert(library(), *objects, "--quality", "high"), (480, 700, 1560, 1300), 800), "glass")


# Position of a direction (x, y, z) of our frame in the map of each program, by the program's own formula in its own axes; v from the top.
def centre_ahead(x, y, z):
    return 0.5 + np.arctan2(x, -z) / (2 * np.pi), np.arccos(y) / np.pi


def openexr(x, y, z):
    return 0.5 - np.arctan2(x, z) / (2 * np.pi), np.arccos(y) / np.pi


def threejs(x, y, z):
    return 0.5 + np.arctan2(z, x) / (2 * np.pi), np.arccos(y) / np.pi


def blender(x, y, z):
    x, y, z = x, -z, y
    return (np.arctan2(y, x) - np.pi) / (-2 * np.pi), np.arccos(z) / np.pi


def unity(x, y, z):
    x, y, z = x, y, -z
    return 0.5 - np.arctan2(z, x) / (2 * np.pi), np.arccos(y) / np.pi


def chrome_ball(picture, uv, size):
    """A mirror ball seen from the photo's camera, far away, under a map."""
    y, x = (1 - (np.mgrid[:size, :size] + 0.5) / size * 2) * [[[1]], [[-1]]]
    depth = np.sqrt(np.maximum(0, 1 - x**2 - y**2))
    # The ray along -Z, mirrored at the normal (x, y, depth).
    u, v = uv(2 * depth * x, np.clip(2 * depth * y, -1, 1), 2 * depth**2 - 1)
    pixels = np.asarray(picture)
    height, width, _ = pixels.shape
    seen = pixels[np.clip((v * height).astype(int), 0, height - 1), np.floor(u * width).astype(int) % width]
    return Image.fromarray(np.where((x**2 + y**2 < 1)[..., None], seen, 255).astype(np.uint8))


def orientations():
    """docs/web.md: the map for each program, and a chrome ball under it."""
    programs = {"lightoctree": centre_ahead, "openexr": openexr, "threejs": threejs, "blender": blender, "unity": unity}
    maps = [panorama(library(), "--at", "0,-0.3,-2", "--orientation", name) for name in programs]
    balls = [chrome_ball(picture, uv, 384).resize((192, 192), Image.Resampling.LANCZOS) for picture, uv in zip(maps, programs.values())]
    for name, picture in zip(programs, maps):
        ImageDraw.Draw(picture).text((6, 4), name, "white", stroke_width=2, stroke_fill="black", font_size=26)
    save(grid([[picture.resize((230, 115), Image.Resampling.LANCZOS) for picture in maps], balls]), "orientations")


def web_page():
    """docs/web.md: the exported page in Chromium."""
    folder = (WORK / "page").resolve()
    run(PROGRAM, "export", library(), "--to", "web", "-o", folder, "--force", "--quiet")
    # Chromium writes the picture once the page is idle; it computes WebGL by itself.
    flags = ("--headless=new", "--no-sandbox", "--hide-scrollbars", "--use-angle=swiftshader", "--enable-unsafe-swiftshader")
    state = "object=chrome&x=800&y=1150&height=0.3"
    shot = WORK / "page.png"
    run("chromium", *flags, "--window-size=1000,840", "--virtual-time-budget=20000", f"--screenshot={shot}", f"file://{folder}/index.html#{state}")
    save(Image.open(shot).convert("RGB"), "web_page")


ALL = [demo, real_photos, sheet, photo_alone, spheres, tea_set, spot, several, mattes, desk_panorama, chrome_lookup, networks, shadows, panorama_prior, lights, sunny, window, lamp, glass, orientations, web_page]


def main():
    WORK.mkdir(parents=True, exist_ok=True)
    for picture in ALL:
        if not sys.argv[4:] or picture.__name__ in sys.argv[4:]:
            print(picture.__name__, flush=True)
            picture()


if __name__ == "__main__":
    main()
