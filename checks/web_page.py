"""A ball on the page of `export --to web`, in Chromium, beside the one of `insert`.

    python checks/web_page.py target/release/lightoctree library.scene --pixel 800,1150 --pixel 1300,1120
"""

import argparse
import base64
import io
import json
import math
import subprocess
import tempfile
from pathlib import Path

import numpy as np
from PIL import Image
from playwright.sync_api import sync_playwright

HEIGHT_M = 0.4
# Share of the ball's radius within which colours are compared.
INNER = 0.85
FLAGS = ["--use-angle=swiftshader", "--enable-unsafe-swiftshader"]


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("program", type=Path)
    parser.add_argument("scene", type=Path)
    parser.add_argument("--pixel", action="append", required=True, help="where the ball stands: U,V")
    parser.add_argument("--chromium", default="/usr/bin/chromium")
    parser.add_argument("--pictures", type=Path, help="folder for the pictures of both")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder, sync_playwright() as playwright:
        folder = Path(folder)
        run(arguments.program, "export", arguments.scene, "--to", "web", "-o", folder / "page")
        browser = playwright.chromium.launch(executable_path=arguments.chromium, args=FLAGS)
        page = browser.new_page(viewport={"width": 1000, "height": 850})
        page.goto(f"file://{folder}/page/index.html")
        page.wait_for_function("globalThis.page?.isReady")
        figures = {"insert": [], "insert under the panorama at the ball": []}
        for pixel in arguments.pixel:
            ours, theirs, centre, radius = pictures(arguments, folder, page, pixel)
            if arguments.pictures:
                arguments.pictures.mkdir(parents=True, exist_ok=True)
                for name, picture in (("page", ours), ("insert", theirs[0])):
                    Image.fromarray(encoded(picture)).save(arguments.pictures / f"{name}_{pixel.replace(',', '_')}.png")
            for (name, found), picture in zip(figures.items(), theirs):
                found.append(compared(ours, picture, centre, radius))
                print(f"{pixel}: page / {name} {np.round(found[-1][0], 3)}, lit side off by {found[-1][1]:.0f}°")
        browser.close()
    for name, found in figures.items():
        ratios, angles = zip(*found)
        print(f"page / {name}: {np.min(ratios):.2f} to {np.max(ratios):.2f}; lit side off by up to {max(angles):.0f}°")


def pictures(arguments, folder, page, pixel):
    """The page's canvas, the pictures of `insert` at its size, in the scene's light and under the panorama at the ball,
    all in linear light, and the ball's place in them."""
    x, y = pixel.split(",")
    page.goto("about:blank")
    page.goto(f"file://{folder}/page/index.html#object=matte&x={x}&y={y}&height={HEIGHT_M}")
    page.wait_for_function("globalThis.page?.isReady")
    url = page.evaluate("document.getElementById('view').toDataURL()")
    ours = Image.open(io.BytesIO(base64.b64decode(url.split(",")[1]))).convert("RGB")
    out, light = folder / "insert.png", folder / "light.exr"
    options = ("--mesh", "builtin:sphere", "--height", HEIGHT_M, "--pixel", pixel, "--match-look", "off", "--json")
    insert = (arguments.program, "insert", arguments.scene, *options, "-o", out, "--force")
    told = run(*insert)
    theirs = [Image.open(out).convert("RGB")]
    position = np.array(json.loads(told)["objects"][0]["positions_m"][0])
    room = json.loads((folder / "page/room.js").read_text().partition("= ")[2].rstrip().rstrip(";"))
    camera, up = room["camera"], np.array(room["up"])
    middle = position + 0.5 * HEIGHT_M * up
    scale = ours.width / camera["width"]
    centre = scale * np.array(
        [camera["cx"] + camera["fx"] * middle[0] / -middle[2], camera["cy"] - camera["fy"] * middle[1] / -middle[2]]
    )
    radius = scale * camera["fx"] * 0.5 * HEIGHT_M / -middle[2]
    at = "--at=" + ",".join(map(str, middle))
    run(arguments.program, "envmap", arguments.scene, at, "--light", "plausible", "-o", light, "--force")
    run(*insert, "--lighting", f"envmap:{light}", "--lighting-level", "file")
    theirs.append(Image.open(out).convert("RGB"))
    theirs = [linear(picture.resize(ours.size, Image.Resampling.LANCZOS)) for picture in theirs]
    return linear(ours), theirs, centre, radius


def compared(ours, theirs, centre, radius):
    """The ratio of the means of both on the ball, and the angle between their lit sides."""
    y, x = np.mgrid[: ours.shape[0], : ours.shape[1]] + 0.5
    x, y = (x - centre[0]) / radius, (y - centre[1]) / radius
    inside = np.hypot(x, y) < INNER
    sides = []
    for picture in (ours, theirs):
        values = picture[inside].mean(axis=1)
        design = np.stack([np.ones_like(values), x[inside], y[inside]], axis=1)
        _, across, down = np.linalg.lstsq(design, values, rcond=None)[0]
        sides.append(math.atan2(down, across))
    angle = abs((sides[0] - sides[1] + math.pi) % (2 * math.pi) - math.pi)
    return ours[inside].mean(axis=0) / theirs[inside].mean(axis=0), math.degrees(angle)


def run(*command):
    return subprocess.run([str(part) for part in command], check=True, capture_output=True, text=True).stdout


def linear(picture):
    values = np.asarray(picture) / 255.0
    return np.where(values <= 0.04045, values / 12.92, ((values + 0.055) / 1.055) ** 2.4)


def encoded(values):
    curve = np.where(values <= 0.0031308, 12.92 * values, 1.055 * np.maximum(values, 1e-9) ** (1 / 2.4) - 0.055)
    return np.round(255 * np.clip(curve, 0, 1)).astype(np.uint8)


if __name__ == "__main__":
    main()
