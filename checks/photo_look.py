"""Do inserted objects have the photo's noise and sharpness?

    python checks/photo_look.py target/release/lightoctree PHOTO ... [--work DIR]

Needs numpy, Pillow and OpenEXR. A matte ball is inserted into each photo, with and without `--match-look`. Compared are

- noise: standard deviation of what a 5 x 5 mean leaves, in flat patches of the ball and of the photo of the same brightness
- sharpness: width of the ball's outline and of the photo's sharper edges (their lower quartile), 25 to 75 %
- a classifier (logistic regression, learned on half of the photos and tested on the other, both ways) that tells flat
  patches of 16 x 16 pixels of the ball from those of the photo by their noise; chance is 50 %

All measures are independent of the program's own. Asked: noise and sharpness within 20 %, at most 65 % told apart.
"""

import argparse
import os
import subprocess
import sys
import tempfile

import numpy as np
from PIL import Image

PATCH = 16
MATERIAL = '{"base_color":[0.45,0.45,0.45],"roughness":1.0,"metallic":0.0}'


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("program")
    parser.add_argument("photos", nargs="+")
    parser.add_argument("--work")
    arguments = parser.parse_args()
    work = arguments.work or tempfile.mkdtemp(prefix="lightoctree-look-")
    os.makedirs(work, exist_ok=True)
    rows, features = [], {"off": [], "on": []}
    for path in arguments.photos:
        photo, composites, balls = insert(arguments.program, path, work)
        ball = balls["off"]
        row = [os.path.basename(path)[:28]]
        for look in ["off", "on"]:
            own, others = flat_patches(composites[look], ball, photo)
            if len(own) < 8:
                break
            features[look].append((np.array([describe(p) for p in own]), np.array([describe(p) for p in others])))
            row += [ratio([noise(p) for p in own], [noise(p) for p in others])]
        else:
            edge = photo_edge(photo, ball)
            row += [outline(balls[look]) / edge for look in ["off", "on"]]
            rows.append(row)
            print("{:28}  noise {:5.2f} -> {:5.2f}   outline {:5.2f} -> {:5.2f}".format(*row), flush=True)
            continue
        print(f"{row[0]:28}  too few flat patches on the ball")
    table = np.array([row[1:] for row in rows])
    print(f"{len(rows)} photos; median of the ball's over the photo's, and how many are within 20 %:")
    for name, column in zip(["noise, off", "noise, on", "outline, off", "outline, on"], table.T):
        print(f"  {name:13} {np.nanmedian(column):5.2f}  {np.mean(np.abs(column - 1) <= 0.2):4.0%}")
    for look in ["off", "on"]:
        print(f"  told apart, {look}: {told_apart(features[look]):.0%}")


def insert(program, path, work):
    """Returns the photo, and without and with its look the composites and the coverage of the ball."""
    name = os.path.join(work, os.path.splitext(os.path.basename(path))[0])
    photo = Image.open(path).convert("RGB")
    width, height = photo.size
    scene = name + ".scene"
    if not os.path.exists(scene):
        subprocess.run([program, "--quiet", "estimate", path, "-o", scene], check=True)
    composites = {}
    for look in ["off", "on"]:
        out = f"{name}.{look}.png"
        for pixel in [(0.5, 0.72), (0.4, 0.85), (0.6, 0.85), (0.5, 0.95)]:
            at = f"{int(width * pixel[0])},{int(height * pixel[1])}"
            layers = f"{name}.{look}.exr"
            command = [program, "--quiet", "insert", scene, "--mesh", "builtin:sphere", "--material", MATERIAL, "--height", "0.45"]
            command += ["--pixel", at, "--match-look", look, "--force", "--layers", layers, "-o", out]
            done = subprocess.run(command, capture_output=True, text=True)
            if done.returncode == 0:
                break
        else:
            sys.exit(f"{path}: {done.stderr}")
        composites[look] = np.asarray(Image.open(out).convert("RGB"), dtype=np.float64)
    photo = np.asarray(photo, dtype=np.float64)
    return photo, composites, {look: alpha(f"{name}.{look}.exr") for look in composites}


def alpha(path):
    import OpenEXR

    with OpenEXR.File(path, separate_channels=True) as file:
        return np.array(file.channels()["object.A"].pixels, dtype=np.float64)


def box(image, radius):
    """Mean over a square, by sums along both axes."""
    for axis in [0, 1]:
        padded = np.concatenate([np.repeat(np.take(image, [0], axis), radius + 1, axis), image,
                                 np.repeat(np.take(image, [-1], axis), radius, axis)], axis)
        sums = np.cumsum(padded, axis)
        n = 2 * radius + 1
        image = (np.take(sums, range(n, sums.shape[axis]), axis) - np.take(sums, range(0, sums.shape[axis] - n), axis)) / n
    return image


def patches(image, mask):
    rows, columns = (n // PATCH for n in image.shape[:2])
    for y in range(rows):
        for x in range(columns):
            at = (slice(y * PATCH, y * PATCH + PATCH), slice(x * PATCH, x * PATCH + PATCH))
            patch = image[at]
            if mask[at].all() and (patch < 247).all() and (patch > 5).all():
                yield patch


def flat_patches(composite, ball, photo):
    """Flat patches of the ball, and as many of the photo with the same distribution of brightness."""
    own = list(patches(composite, ball >= 1.0))
    # the ball's middle is flat; its sides are steep
    own = [p for p in own if slope(p) < 14]
    others = sorted((p for p in patches(photo, box(ball, 8) <= 0.0)), key=structure)
    by_level = {}
    for patch in others:
        by_level.setdefault(int(patch.mean() // 16), []).append(patch)
    by_level = {level: found[: max(len(found) // 6, 4)] for level, found in by_level.items()}
    pairs = [(p, by_level.get(int(p.mean() // 16), [])) for p in own]
    pairs = [(p, near) for p, near in pairs if near]
    return [p for p, _ in pairs], [near[i % len(near)] for i, (_, near) in enumerate(pairs)]


def slope(patch):
    return np.ptp(box(patch, 2)[2:-2:11, 2:-2:11].mean(2))


def structure(patch):
    """What is left in smoothed values beside a plane."""
    smooth = box(patch.mean(2), 2)[2:-2, 2:-2]
    y, x = np.mgrid[: smooth.shape[0], : smooth.shape[1]]
    plane = np.stack([np.ones(smooth.size), x.ravel(), y.ravel()], 1)
    return np.std(smooth.ravel() - plane @ np.linalg.lstsq(plane, smooth.ravel(), rcond=None)[0])


def residual(patch):
    return (patch - box(patch, 2))[2:-2, 2:-2]


def noise(patch):
    return np.std(residual(patch))


def ratio(own, others):
    return np.median(own) / max(np.median(others), 1e-9)


def describe(patch):
    """Noise in sixteen figures: strength by channel, correlations along rows, columns and of channels, shape."""
    r = residual(patch)
    deviation = r.std((0, 1)) + 1e-3
    unit = r / deviation
    lag = lambda dy, dx: (unit[: unit.shape[0] - dy, : unit.shape[1] - dx] * unit[dy:, dx:]).mean()
    channels = [(unit[..., a] * unit[..., b]).mean() for a, b in [(0, 1), (1, 2), (0, 2)]]
    coarse = np.std(box(patch, 1)[2:-2, 2:-2] - box(patch, 3)[2:-2, 2:-2])
    shape = (np.abs(unit) ** 3).mean()
    return [*np.log(deviation), np.log(coarse + 1e-3), lag(0, 1), lag(1, 0), lag(0, 2), lag(2, 0), lag(1, 1), *channels, shape]


def told_apart(features):
    """Share of patches that a logistic regression of the other half of the photos tells right."""
    right, count = 0, 0
    for test in [0, 1]:
        learn = [pair for i, pair in enumerate(features) if i % 2 != test]
        held = [pair for i, pair in enumerate(features) if i % 2 == test]
        if not learn or not held:
            return float("nan")
        # relative to the photo, since photos differ more than objects within them
        stack = lambda pairs: (np.concatenate([np.concatenate([a - b.mean(0), b - b.mean(0)]) for a, b in pairs]),
                               np.concatenate([np.r_[np.ones(len(a)), np.zeros(len(b))] for a, b in pairs]))
        x, y = stack(learn)
        mean, scale = x.mean(0), x.std(0) + 1e-9
        basis = lambda x: np.concatenate([np.ones((len(x), 1)), (x - mean) / scale, ((x - mean) / scale) ** 2], 1)
        weights = np.zeros(basis(x).shape[1])
        for _ in range(60):
            p = 1 / (1 + np.exp(-np.clip(basis(x) @ weights, -30, 30)))
            b = basis(x)
            hessian = (b * (p * (1 - p))[:, None]).T @ b + 1.0 * np.eye(b.shape[1])
            weights += np.linalg.solve(hessian, b.T @ (y - p) - 1.0 * weights)
        x, y = stack(held)
        right += np.sum((basis(x) @ weights > 0) == (y > 0.5))
        count += len(y)
    return right / count


def widths(image, starts, directions):
    """Widths of edges along lines, 25 to 75 %, in pixels."""
    found = []
    for (y, x), (dy, dx) in zip(starts, directions):
        t = np.arange(-8, 8.01, 0.25)
        ys, xs = y + dy * t, x + dx * t
        if ys.min() < 0 or xs.min() < 0 or ys.max() >= image.shape[0] - 1 or xs.max() >= image.shape[1] - 1:
            continue
        y0, x0 = ys.astype(int), xs.astype(int)
        fy, fx = ys - y0, xs - x0
        line = (image[y0, x0] * (1 - fx) + image[y0, x0 + 1] * fx) * (1 - fy) + (
            image[y0 + 1, x0] * (1 - fx) + image[y0 + 1, x0 + 1] * fx) * fy
        low, high = line[:13].mean(), line[-13:].mean()
        step = high - low
        if abs(step) < 0.06 or np.ptp(line[:13]) > 0.25 * abs(step) or np.ptp(line[-13:]) > 0.25 * abs(step):
            continue
        share = (line - low) / step
        crossed = [np.argmax(share >= level) for level in (0.25, 0.75)]
        if crossed[0] and crossed[1]:
            cross = [t[c - 1] + 0.25 * (level - share[c - 1]) / max(share[c] - share[c - 1], 1e-9)
                     for c, level in zip(crossed, (0.25, 0.75))]
            found.append(cross[1] - cross[0])
    return np.array(found)


def linear(image):
    v = image / 255
    return (np.where(v <= 0.04045, v / 12.92, ((v + 0.055) / 1.055) ** 2.4) * [0.2126, 0.7152, 0.0722]).sum(2)


def gradient(image):
    gy, gx = np.gradient(image)
    return gy, gx, np.hypot(gy, gx)


def outline(ball):
    """Width of the ball's outline."""
    gy, gx, strength = gradient(box(ball, 1))
    places = np.argwhere((strength > 0.15) & (np.abs(ball - 0.5) < 0.3))[::3]
    directions = [(gy[y, x] / strength[y, x], gx[y, x] / strength[y, x]) for y, x in places]
    found = widths(ball, places, directions)
    return np.median(found) if len(found) >= 8 else np.nan


def photo_edge(photo, ball):
    """Width of the sharper of the photo's edges."""
    image = linear(photo)
    gy, gx, strength = gradient(image)
    places, directions = [], []
    tile = 24
    for top in range(16, image.shape[0] - tile - 16, tile):
        for left in range(16, image.shape[1] - tile - 16, tile):
            part = strength[top : top + tile, left : left + tile]
            y, x = np.unravel_index(np.argmax(part), part.shape)
            y, x = y + top, x + left
            if strength[y, x] > 0.02 and ball[y, x] == 0:
                places.append((y, x))
                directions.append((gy[y, x] / strength[y, x], gx[y, x] / strength[y, x]))
    found = widths(image, places, directions)
    return np.percentile(found, 25) if len(found) >= 8 else np.nan


if __name__ == "__main__":
    main()
