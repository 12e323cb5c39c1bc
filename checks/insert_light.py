"""The light of `insert` on a matte ball, beside that of the panorama at the ball's middle, which `envmap` writes.

    python checks/insert_light.py target/release/lightoctree PHOTO:U,V …

U,V is where the ball stands, in shares of the photo's width and height.
"""

import argparse
import json
import subprocess
import tempfile
from pathlib import Path

import numpy as np
import OpenEXR

HEIGHT_M = 0.3
# Share of the ball's radius within which colours are compared.
INNER = 0.8
LIGHTS = ("plausible", "expected", "even")


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("program", type=Path)
    parser.add_argument("photos", nargs="+", metavar="PHOTO:U,V")
    arguments = parser.parse_args()
    for text in arguments.photos:
        photo, _, place = text.rpartition(":")
        with tempfile.TemporaryDirectory() as folder:
            ratios = compared(arguments.program, photo, [float(share) for share in place.split(",")], Path(folder))
        print(Path(photo).name, *(f"{light} {ratio:.2f}" for light, ratio in zip(LIGHTS, ratios)), flush=True)


def compared(program, photo, place, folder):
    """The ratio of the means on the ball for each choice of light."""

    def run(*command):
        command = [str(part) for part in (program, *command)]
        return subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True).stdout

    scene, picture, panorama = folder / "room.scene", folder / "ball.exr", folder / "light.exr"
    run("estimate", photo, "-o", scene, "--quiet")
    known = json.loads(run("inspect", scene, "--json"))
    camera, up = known["camera"], np.array(known["room"]["up"])
    pixel = f"{place[0] * camera['width']:.0f},{place[1] * camera['height']:.0f}"
    ball = ("--mesh", "builtin:sphere", "--height", HEIGHT_M, "--pixel", pixel, "--match-look", "off")
    insert = ("insert", scene, *ball, "-o", picture, "--force", "--quiet", "--json")
    ratios = []
    for light in LIGHTS:
        told = json.loads(run(*insert, "--light", light))
        middle = np.array(told["objects"][0]["positions_m"][0]) + 0.5 * HEIGHT_M * up
        mask = disc(camera, middle)
        of_octree = pixels(picture)[mask].mean()
        at = "--at=" + ",".join(map(str, middle))
        run("envmap", scene, at, "--light", light, "--size", "512x256", "-o", panorama, "--force", "--quiet")
        run(*insert, "--lighting", f"envmap:{panorama}", "--lighting-level", "file")
        ratios.append(of_octree / pixels(picture)[mask].mean())
    return ratios


def disc(camera, middle):
    """The pixels of the ball's inner part."""
    x = camera["cx"] + camera["fx"] * middle[0] / -middle[2]
    y = camera["cy"] - camera["fy"] * middle[1] / -middle[2]
    radius = camera["fx"] * 0.5 * HEIGHT_M / -middle[2]
    rows, columns = np.mgrid[: camera["height"], : camera["width"]] + 0.5
    return np.hypot(columns - x, rows - y) < INNER * radius


def pixels(file):
    return OpenEXR.File(str(file)).channels()["RGB"].pixels


if __name__ == "__main__":
    main()
