"""Builds the Blender extension, with the Python package of this platform inside.

    python blender/build.py WHEEL... -o FOLDER

WHEEL is made by `pip wheel --no-deps ./python`. With wheels of several platforms the extension is for all of them. The
version is that of the wheels. Prints the path of the zip.
"""

import argparse
import re
import zipfile
from pathlib import Path

SOURCE = Path(__file__).parent / "room_light"
LICENSES = [Path(__file__).parents[1] / "python" / name for name in ("LICENSE-APACHE", "LICENSE-MIT")]
# Platforms of extensions by the platform tags of wheels.
PLATFORMS = {
    r"linux_x86_64": "linux-x64",
    r"linux_aarch64": "linux-arm64",
    r"macosx_\d+_\d+_x86_64": "macos-x64",
    r"macosx_\d+_\d+_arm64": "macos-arm64",
    r"win_amd64": "windows-x64",
    r"win_arm64": "windows-arm64",
}
# A fixed date, so that the same content gives the same bytes.
DATE = (2020, 1, 1, 0, 0, 0)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("wheels", type=Path, nargs="+", metavar="WHEEL")
    parser.add_argument("-o", "--output", type=Path, default=Path("."), metavar="FOLDER")
    arguments = parser.parse_args()
    print(build(arguments.wheels, arguments.output))


def build(wheels, folder):
    """Writes the zip and returns its path."""
    parts = [wheel.name.removesuffix(".whl").split("-") for wheel in wheels]
    versions, platforms = {part[1] for part in parts}, sorted({platform(part[-1]) for part in parts})
    if len(versions) != 1:
        raise SystemExit(f"the wheels have different versions: {', '.join(sorted(versions))}")
    [version] = versions
    manifest = (SOURCE / "blender_manifest.toml").read_text()
    listed = [f"./wheels/{wheel.name}" for wheel in wheels]
    head = f'version = "{version}"\nplatforms = {quoted(platforms)}\nwheels = {quoted(listed)}\n\n[permissions]'
    manifest = manifest.replace("[permissions]", head)
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"room_light-{version}-{'-'.join(platforms).replace('-', '_')}.zip"
    with zipfile.ZipFile(path, "w") as archive:
        add(archive, "blender_manifest.toml", manifest.encode())
        for file in sorted(SOURCE.glob("*.py")) + LICENSES:
            add(archive, file.name, file.read_bytes())
        for wheel in wheels:
            add(archive, f"wheels/{wheel.name}", wheel.read_bytes(), zipfile.ZIP_STORED)
    return path


def platform(tags):
    """The extension's platform of a wheel's platform tags, such as manylinux_2_17_x86_64.manylinux2014_x86_64."""
    for pattern, name in PLATFORMS.items():
        # manylinux_2_17_x86_64 and manylinux2014_x86_64
        if any(re.search(pattern.replace("linux_", r"linux.*_") + "$", tag) for tag in tags.split(".")):
            return name
    raise SystemExit(f"no platform of Blender is {tags}")


def quoted(values):
    return "[" + ", ".join(f'"{value}"' for value in values) + "]"


def add(archive, name, content, compression=zipfile.ZIP_DEFLATED):
    entry = zipfile.ZipInfo(name, DATE)
    entry.compress_type = compression
    entry.external_attr = 0o644 << 16
    archive.writestr(entry, content)


if __name__ == "__main__":
    main()
