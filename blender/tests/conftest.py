"""The extension, installed from its zip into a Blender of its own, and a photo with depth.

Run by a Python that has `bpy` and pytest: ROOM_LIGHT_ZIP=room_light-….zip pytest blender/tests
"""

import os
import tempfile
from pathlib import Path

# Before Blender starts: nothing of the user's own is read or written.
os.environ["BLENDER_USER_RESOURCES"] = tempfile.mkdtemp(prefix="room-light-tests-")

import bpy
import pytest

ROOT = Path(__file__).parents[2]
ASSETS = ROOT / "apps/lightoctree-cli/assets"
EXTENSION = "bl_ext.user_default.room_light"


def pytest_configure():
    """Installs the zip as a user does, before the tests import it."""
    bpy.ops.extensions.package_install_files(
        filepath=os.path.abspath(os.environ["ROOM_LIGHT_ZIP"]), repo="user_default", enable_on_install=True
    )
    assert EXTENSION in bpy.context.preferences.addons.keys()


@pytest.fixture(autouse=True)
def new_file():
    """Opens a new file of Blender, with its cube, camera and light."""
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=False)
    if EXTENSION not in bpy.context.preferences.addons.keys():
        bpy.ops.preferences.addon_enable(module=EXTENSION)


@pytest.fixture(scope="session")
def photo(tmp_path_factory):
    """The library at a quarter of its size: fewer pixels to encode, the same room."""
    file = tmp_path_factory.mktemp("photos") / "library.png"
    image = bpy.data.images.load(str(ASSETS / "library_color.jpg"))
    image.scale(480, 360)
    image.file_format = "PNG"
    image.save(filepath=str(file))
    bpy.data.images.remove(image)
    return file


@pytest.fixture(scope="session")
def depth():
    return ASSETS / "library_lidar_depth.png"


@pytest.fixture
def room(photo, depth):
    """A room of the photo with depth."""
    settings = bpy.context.scene.room_light
    settings.photo, settings.depth, settings.hfov_deg = str(photo), str(depth), 71.7
    assert bpy.ops.room_light.make_room() == {"FINISHED"}
    return bpy.context.scene.room_light.active
