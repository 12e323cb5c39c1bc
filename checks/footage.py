"""Whether an object stays in place in footage: a disc on a flat, textured surface beside that surface's own motion.

    python checks/footage.py target/release/lightoctree 'images/%04d.jpg' transforms.json --scene 12 --pixel 300,1400 [--last 35]

Estimates plate 12, lays a thin disc on the surface at the pixel, and inserts it into all plates. OpenCV's SIFT finds how the surface
around the pixel moves from plate to plate, as a homography; its image of the disc's centre is where that belongs. Prints the
distances for the scale of the track that `insert` finds and for a few others, in pixels. A photo that shows one plane around the
pixel, such as a wall or a floor, is needed. Needs `pip install numpy opencv-python-headless OpenEXR`.
"""

import argparse
import math
import os
import re
import subprocess
import tempfile

import cv2
import numpy as np
import OpenEXR

AROUND = 0.3
"""Radius around the pixel in which the surface's motion is measured, as a share of the image's width."""
LEAST_MATCHES = 30
DISC_M = 0.06


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("program")
    parser.add_argument("plate")
    parser.add_argument("camera")
    parser.add_argument("--scene", type=int, required=True)
    parser.add_argument("--pixel", required=True)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--last", type=int, default=10**6)
    parser.add_argument("--folder", default=tempfile.mkdtemp())
    arguments = parser.parse_args()
    folder = arguments.folder
    os.makedirs(folder, exist_ok=True)
    name = lambda file: os.path.join(folder, file)
    write_disc(name("disc.obj"))
    photo = arguments.plate % arguments.scene
    run(arguments.program, "estimate", photo, "--intrinsics", arguments.camera, "-o", name("room.scene"), "--force")

    pixel = np.array([float(value) for value in arguments.pixel.split(",")])
    motions = surface_motion(arguments, photo, pixel)
    print(f"{len(motions)} plates show the surface")
    print("scale            slide: median, largest, pixels")
    found = insert(arguments, name, None)
    print(f"{'found: ' + str(found[1]):16s} {slide(found[0], motions, arguments.scene)}")
    for factor in [0.8, 1.25]:
        if found[1]:
            print(f"{factor:<4} x found     {slide(insert(arguments, name, factor * found[1])[0], motions, arguments.scene)}")


def insert(arguments, name, scale):
    """Returns the disc's centre in each plate by its number, and the scale of the track."""
    options = ["--track-scale", str(scale)] if scale else []
    output = run(
        arguments.program, "insert", name("room.scene"), "--mesh", name("disc.obj"), "--pixel", arguments.pixel, "--align", "surface",
        "--material", "matte-black", "--plate", arguments.plate, "--camera", arguments.camera, "--quality", "draft",
        "--plate-range", f"{arguments.first}-{arguments.last}", "-o", name("comp_%04d.png"), "--layers", name("layers_%04d.exr"),
        "--force", *options,
    )  # fmt: skip
    text = re.search(r"([0-9.e-]+) m per unit", output)
    places = {}
    for file in sorted(os.listdir(os.path.dirname(name("x")))):
        number = re.fullmatch(r"layers_(\d+)\.exr", file)
        if not number:
            continue
        with OpenEXR.File(name(file), separate_channels=True) as exr:
            alpha = np.array(exr.channels()["object.A"].pixels)
        os.remove(name(file))
        if alpha.sum() > 20 and not (alpha[0].any() or alpha[-1].any() or alpha[:, 0].any() or alpha[:, -1].any()):
            rows, columns = np.indices(alpha.shape) + 0.5
            places[int(number[1])] = np.array([(columns * alpha).sum(), (rows * alpha).sum()]) / alpha.sum()
    return places, float(text[1]) if text else None


def surface_motion(arguments, photo, pixel):
    """Returns the homography of the surface around `pixel` from the scene's plate to each plate."""
    sift = cv2.SIFT_create(8000)
    first = cv2.imread(photo, cv2.IMREAD_GRAYSCALE)
    mask = np.zeros_like(first)
    cv2.circle(mask, tuple(int(value) for value in pixel), int(AROUND * first.shape[1]), 255, -1)
    points, features = sift.detectAndCompute(first, mask)
    places = {}
    pattern = os.path.basename(arguments.plate)
    numbered = re.compile(re.sub(r"%0?\d?d", r"(\\d+)", pattern))
    for file in sorted(os.listdir(os.path.dirname(arguments.plate) or ".")):
        match = numbered.fullmatch(file)
        if not match or not arguments.first <= int(match[1]) <= arguments.last:
            continue
        image = cv2.imread(os.path.join(os.path.dirname(arguments.plate), file), cv2.IMREAD_GRAYSCALE)
        others, other_features = sift.detectAndCompute(image, None)
        pairs = cv2.BFMatcher().knnMatch(features, other_features, k=2)
        good = [a for a, b in pairs if a.distance < 0.75 * b.distance]
        if len(good) < LEAST_MATCHES:
            continue
        here = np.float32([points[m.queryIdx].pt for m in good])
        there = np.float32([others[m.trainIdx].pt for m in good])
        homography, inliers = cv2.findHomography(here, there, cv2.RANSAC, 3.0)
        if homography is None or inliers.sum() < LEAST_MATCHES:
            continue
        places[int(match[1])] = homography
    return places


def slide(places, motions, scene):
    if scene not in places:
        return "not in view"
    distances = []
    for number in places.keys() & motions.keys() - {scene}:
        u, v, w = motions[number] @ [*places[scene], 1.0]
        distances.append(float(np.linalg.norm(places[number] - [u / w, v / w])))
    distances.sort()
    return f"{distances[len(distances) // 2]:.1f}, {distances[-1]:.1f} in {len(distances)} plates" if distances else "not in view"


def write_disc(path):
    corners = [(math.cos(2 * math.pi * i / 64), math.sin(2 * math.pi * i / 64)) for i in range(64)]
    with open(path, "w") as file:
        file.write("v 0 0.0005 0\n")
        file.writelines(f"v {DISC_M / 2 * x:.6f} 0.0005 {-DISC_M / 2 * y:.6f}\n" for x, y in corners)
        file.writelines(f"f 1 {i + 2} {(i + 1) % 64 + 2}\n" for i in range(64))


def run(*command):
    done = subprocess.run([str(part) for part in command], capture_output=True, text=True)
    if done.returncode:
        raise SystemExit(f"{' '.join(command[:2])}: {done.stderr}")
    return done.stdout + done.stderr


if __name__ == "__main__":
    main()
