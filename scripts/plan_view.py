#!/usr/bin/env python3
"""Shows a panorama with its plan drawn over it, and measures heights: what one needs to draw a plan (docs/data.md).

    python3 scripts/plan_view.py show PANORAMA.hdr [--plan PLAN.json] [--box U0,V0,U1,V1] [--ev 1] -o view.png
    python3 scripts/plan_view.py height U V_BASE V_TOP [--width 1536]

Points are (column, row) of a panorama that is --width wide (1536). `show` enlarges the box to 1,600 pixels with a grid of labelled lines. `height` tells
the distance and the height of what stands on the floor at row V_BASE and reaches up to V_TOP, both in camera heights.
Needs numpy, opencv-python-headless.
"""

import argparse
import json
import math
import os

os.environ["OPENCV_IO_ENABLE_OPENEXR"] = "1"
import cv2  # noqa: E402
import numpy as np  # noqa: E402


def floor_point(u, v, width):
    """Where the ray of a point meets the floor, in camera heights."""
    azimuth = (u / width) * 2 * math.pi
    below = (v / (width / 2) - 0.5) * math.pi
    if below < 1e-3:
        raise SystemExit(f"({u}, {v}) is not below the horizon")
    return np.array([math.cos(azimuth), math.sin(azimuth)]) / math.tan(below)


def project(point, height, width, near):
    """The column (close to `near`) and row of a point on the floor plan at a height over the floor, in camera heights."""
    column = math.atan2(point[1], point[0]) / (2 * math.pi) * width
    column += round((near - column) / width) * width
    row = (0.5 - math.atan2(height - 1.0, np.hypot(*point)) / math.pi) * width / 2
    return column, row


def edge(a, b, height, width, base_height=0.0):
    """The picture's curve of the straight line between two floor points, at a height."""
    start, end = floor_point(*a, width), floor_point(*b, width)
    near, curve = a[0], []
    for t in np.linspace(0, 1, 24):
        near, row = project(start + t * (end - start), height + base_height, width, near)
        curve.append((near, row))
    return curve


def show(arguments):
    picture = cv2.imread(arguments.panorama, cv2.IMREAD_UNCHANGED)
    if picture is None:
        raise SystemExit(f"{arguments.panorama} cannot be read")
    picture = picture[..., :3].astype(np.float32)
    exposed = picture / max(np.median(picture), 1e-6) * 0.25 * 2**arguments.ev
    tone = np.clip(exposed / (1 + exposed / 4), 0, 1) ** (1 / 2.2)
    u0, v0, u1, v1 = arguments.box
    width, scale = arguments.width, 1600 / (arguments.box[2] - arguments.box[0])
    size = (1600, round((v1 - v0) * scale))
    x = ((u0 + (np.arange(size[0]) + 0.5) / scale) / width * picture.shape[1] - 0.5) % picture.shape[1]
    y = (v0 + (np.arange(size[1]) + 0.5) / scale) / (width / 2) * picture.shape[0] - 0.5
    maps = np.meshgrid(x.astype(np.float32), y.astype(np.float32))
    image = (cv2.remap(tone, *maps, cv2.INTER_CUBIC, borderMode=cv2.BORDER_WRAP).clip(0, 1) * 255).astype(np.uint8)

    def at(point):
        return round((point[0] - u0) * scale), round((point[1] - v0) * scale)

    def line(curve, color, closed=False, thickness=1):
        for shift in (-width, 0, width):
            points = np.array([at((u + shift, v)) for u, v in curve], np.int32)
            cv2.polylines(image, [points], closed, color, thickness, cv2.LINE_AA)

    step = next(s for s in (5, 10, 20, 50, 100, 200) if s * scale >= 70)
    for u in range(math.ceil(u0 / step) * step, int(u1) + 1, step):
        x = at((u, 0))[0]
        cv2.line(image, (x, 0), (x, size[1]), (150, 150, 150), 1)
        cv2.putText(image, str(u), (x + 2, 12), cv2.FONT_HERSHEY_SIMPLEX, 0.42, (0, 255, 255), 1, cv2.LINE_AA)
    for v in range(math.ceil(v0 / step) * step, int(v1) + 1, step):
        y = at((0, v))[1]
        cv2.line(image, (0, y), (size[0], y), (150, 150, 150), 1)
        cv2.putText(image, str(v), (2, y - 3), cv2.FONT_HERSHEY_SIMPLEX, 0.42, (0, 255, 255), 1, cv2.LINE_AA)
    if arguments.plan:
        plan = json.load(open(arguments.plan))
        camera = plan["camera_height_m"]
        width = plan["width"]
        if width != arguments.width:
            raise SystemExit(f"the plan is for --width {width}")
        top = (plan.get("ceiling_m") or plan.get("wall_top_m")) / camera
        corners = plan["floor"]
        for a, b in zip(corners, corners[1:] + corners[:1]):
            # Of two directions around, the one that the walls take.
            b = [b[0] + round((a[0] - b[0]) / width) * width, b[1]]
            line(edge(a, b, 0, width), (0, 220, 0), thickness=2)
            line(edge(a, b, top, width), (255, 120, 0), thickness=2)
            line([a, edge(a, b, top, width)[0]], (255, 120, 0))
        for upright in plan.get("uprights", []):
            for a, b in zip(upright["base"], upright["base"][1:]):
                low, high = (upright.get(k, 0) / camera for k in ("from_m", "height_m"))
                curve = edge(a, b, low, width) + edge(a, b, high, width)[::-1]
                line(curve, (0, 0, 255), closed=True)
        for level in plan.get("tops", []):
            line(level["outline"], (0, 255, 255), closed=True)
        for unknown in plan.get("unknown", []):
            line(unknown, (255, 0, 255), closed=True)
    cv2.imwrite(arguments.output, image)
    print(f"{arguments.output}: {size[0]} x {size[1]}, {scale:.2f} pixels each")


def height(arguments):
    point = floor_point(arguments.u, arguments.v_base, arguments.width)
    distance = float(np.hypot(*point))
    above = (0.5 - arguments.v_top / (arguments.width / 2)) * math.pi
    print(f"distance {distance:.3f}, height {1 + distance * math.tan(above):.3f} camera heights")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    commands = parser.add_subparsers(required=True)
    view = commands.add_parser("show")
    view.add_argument("panorama")
    view.add_argument("--plan")
    view.add_argument("--box", type=lambda text: [float(x) for x in text.split(",")], default=[0, 0, 1536, 768])
    view.add_argument("--ev", type=float, default=0.0)
    view.add_argument("--width", type=int, default=1536)
    view.add_argument("-o", "--output", required=True)
    view.set_defaults(run=show)
    measure = commands.add_parser("height")
    for name in ("u", "v_base", "v_top"):
        measure.add_argument(name, type=float)
    measure.add_argument("--width", type=int, default=1536)
    measure.set_defaults(run=height)
    arguments = parser.parse_args()
    arguments.run(arguments)


if __name__ == "__main__":
    main()
