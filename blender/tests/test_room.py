"""Rooms, environments, settings and errors, in a real Blender without window."""

import math
import os

import bpy
import numpy as np
import pytest
from mathutils import Matrix, Vector

SETTINGS = ("resolution_x", "resolution_y", "film_transparent")


def roles(collection):
    return sorted(thing["room_light_role"] for thing in collection.all_objects)


def named(collection, role):
    """The object of a role."""
    return next(thing for thing in collection.all_objects if thing.get("room_light_role") == role)


def pixels_of(image):
    """The rows of an image from the lowest, RGBA."""
    width, height = image.size
    pixels = np.empty(width * height * 4, dtype=np.float32)
    image.pixels.foreach_get(pixels)
    return pixels.reshape(height, width, 4)


def state():
    """What the extension must leave alone or restore."""
    scene = bpy.context.scene
    return {
        "objects": sorted(thing.name for thing in scene.objects),
        "camera": scene.camera,
        "world": scene.world,
        "render": [getattr(scene.render, name) for name in SETTINGS],
        "view": (scene.view_settings.view_transform, scene.view_settings.look),
        "selected": [thing.name for thing in bpy.context.selected_objects],
        "active": bpy.context.view_layer.objects.active,
        "frames": (scene.frame_start, scene.frame_end, scene.frame_current, scene.render.fps),
        "blocks": {
            kind: sorted(block.name for block in getattr(bpy.data, kind))
            for kind in ("meshes", "materials", "images", "worlds", "collections", "lights", "cameras", "node_groups")
        },
    }


def test_room_has_camera_surfaces_and_catcher(room, photo):
    scene = bpy.context.scene
    assert room.name == "library"
    assert {"Camera", "Room", "Photo", "ShadowCatcher"} <= set(roles(room)) and "Backdrop" not in roles(room)
    assert scene.camera == named(room, "Camera") and scene.camera.data.background_images[0].image.name == "library"
    assert (scene.render.resolution_x, scene.render.resolution_y) == (480, 360)
    assert scene.render.film_transparent and scene.view_settings.view_transform == "Standard"
    horizontal = 2 * math.atan(scene.camera.data.sensor_width / 2 / scene.camera.data.lens)
    assert math.degrees(horizontal) == pytest.approx(71.7, abs=0.1)
    height = named(room, "Camera").matrix_world.translation.z
    assert 0.8 < height < 2.2, "the floor is at 0"
    assert os.path.exists(photo)
    for image in bpy.data.images:
        assert image.packed_file is not None or image.source == "VIEWER", image.name


def test_rest_of_the_file_is_left_alone(photo, depth):
    before = state()
    settings = bpy.context.scene.room_light
    settings.photo, settings.depth = str(photo), str(depth)
    bpy.ops.room_light.make_room()
    for name in before["objects"]:
        assert name in bpy.context.scene.objects
    assert [state()[key] for key in ("selected", "active", "frames")] == [
        before[key] for key in ("selected", "active", "frames")
    ]
    bpy.ops.room_light.light_object()
    bpy.ops.room_light.reset()
    assert state() == before


def test_changes_of_the_user_survive_a_reset(room):
    scene = bpy.context.scene
    scene.render.resolution_x = 1000
    scene.camera = bpy.data.objects["Camera"]
    world = bpy.data.worlds.new("own")
    scene.world = world
    bpy.data.objects["Cube"].users_collection[0].objects.unlink(bpy.data.objects["Cube"])
    room.objects.link(bpy.data.objects["Cube"])
    bpy.ops.room_light.reset()
    assert scene.render.resolution_x == 1000 and scene.render.resolution_y == 1080
    assert scene.camera.name == "Camera" and scene.world == world
    assert "Cube" in scene.objects, "an object of the user in the room's collection stays"


def test_second_photo_makes_a_second_room(room, photo):
    scene = bpy.context.scene
    before = scene.room_light.before_world
    scene.room_light.depth = ""
    bpy.ops.room_light.make_room()
    second = scene.room_light.active
    assert second != room and second.name == "library.001"
    assert (room.hide_render, second.hide_render) == (True, False)
    bpy.ops.room_light.use_room(room=room.name)
    assert (room.hide_render, second.hide_render) == (False, True) and scene.camera == named(room, "Camera")
    bpy.ops.room_light.reset(room=room.name)
    assert scene.room_light.active == second and scene.camera == named(second, "Camera") and not second.hide_render
    bpy.ops.room_light.reset()
    assert scene.world == before and scene.camera.name == "Camera"


def test_environment_is_the_panorama_at_the_object(room):
    import lightoctree

    cube = bpy.data.objects["Cube"]
    cube.scale = (0.1, 0.1, 0.1)
    cube.location = (0.2, 1.6, 0.4)
    bpy.context.view_layer.update()
    assert bpy.ops.room_light.light_object() == {"FINISHED"}
    properties = room.room_light
    image = properties.world.node_tree.nodes["Environment Texture"].image
    pixels = pixels_of(image)[::-1, :, :3]
    scene = lightoctree.Scene.from_bytes(room["room_light_scene"])
    at = named(room, "World").matrix_world.inverted() @ cube.location
    panorama = scene.environment(tuple(at), (1024, 512), light="plausible")
    # Mean radiance about a direction of the room, by both conventions.
    ahead = (named(room, "Camera").matrix_world.to_3x3() @ Vector((0.3, -0.4, -1))).normalized()
    in_camera = Vector((0.3, -0.4, -1)).normalized()
    u = 0.5 + math.atan2(in_camera.x, -in_camera.z) / (2 * math.pi)
    v = math.acos(in_camera.y) / math.pi
    expected = panorama[round(v * 512) - 4 : round(v * 512) + 4, round(u * 1024) - 4 : round(u * 1024) + 4].mean((0, 1))
    rotation = properties.world.node_tree.nodes["Mapping"].inputs["Rotation"].default_value
    turned = rotation.to_matrix() @ ahead
    u = 0.5 - math.atan2(turned.y, turned.x) / (2 * math.pi)
    v = 0.5 - math.asin(turned.z) / math.pi
    found = pixels[round(v * 512) - 4 : round(v * 512) + 4, round(u * 1024) - 4 : round(u * 1024) + 4].mean((0, 1))
    assert found == pytest.approx(expected, rel=0.02)
    surfaces = [thing for thing in room.all_objects if thing["room_light_role"] in ("Room", "Photo", "Lamp")]
    assert surfaces and all(thing.hide_render for thing in surfaces)
    properties.source = "ROOM"
    assert not any(thing.hide_render for thing in surfaces)


def test_environment_follows_a_room_that_was_moved(room):
    cube = bpy.data.objects["Cube"]
    cube.scale = (0.1, 0.1, 0.1)
    cube.location = (0.2, 1.6, 0.4)
    bpy.context.view_layer.update()
    bpy.ops.room_light.light_object()
    texture = room.room_light.world.node_tree.nodes["Environment Texture"]
    before = pixels_of(texture.image)
    top = next(thing for thing in room.all_objects if thing.parent is None and thing["room_light_role"] == "Scene")
    move = Matrix.Translation((3, -2, 1)) @ Matrix.Rotation(1.1, 4, "Z")
    top.matrix_world = move @ top.matrix_world
    cube.matrix_world = move @ cube.matrix_world
    bpy.context.view_layer.update()
    bpy.ops.room_light.light_object()
    # The last bits of the position decide at edges.
    assert np.quantile(np.abs(pixels_of(texture.image) - before), 0.999) < 1e-3


def test_saved_file_opens_again(room, tmp_path):
    bpy.ops.room_light.light_object()
    before = pixels_of(room.room_light.world.node_tree.nodes["Environment Texture"].image)
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "room.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "room.blend"))
    room = bpy.context.scene.room_light.active
    image = room.room_light.world.node_tree.nodes["Environment Texture"].image
    assert np.array_equal(pixels_of(image), before)
    assert bpy.context.scene.camera == named(room, "Camera")
    assert all(image.has_data or image.pixels[0] >= 0 for image in bpy.data.images if image.source == "FILE")
    bpy.context.view_layer.objects.active = bpy.data.objects["Cube"]
    assert bpy.ops.room_light.light_object() == {"FINISHED"}
    assert bpy.ops.room_light.reset() == {"FINISHED"}


def test_scene_files_are_rooms(room, tmp_path):
    file = tmp_path / "kept.scene"
    file.write_bytes(room["room_light_scene"])
    bpy.context.scene.room_light.photo = str(file)
    bpy.ops.room_light.make_room()
    assert bpy.context.scene.room_light.active.name == "kept"


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({}, "Choose a photo"),
        ({"photo": "/missing/photo.jpg"}, "no such file"),
        ({"photo": "broken.jpg"}, "broken.jpg"),
        ({"photo": "library", "depth": "broken.jpg"}, "broken.jpg"),
    ],
)
def test_errors_leave_nothing_behind(values, message, photo, tmp_path):
    (tmp_path / "broken.jpg").write_bytes(b"no picture")
    files = {"broken.jpg": str(tmp_path / "broken.jpg"), "library": str(photo)}
    before = state()
    for name, value in values.items():
        setattr(bpy.context.scene.room_light, name, files.get(value, value))
    with pytest.raises(RuntimeError, match=message):
        bpy.ops.room_light.make_room()
    assert state() == before


def test_unreadable_photo_is_named(photo, tmp_path):
    if os.geteuid() == 0:
        pytest.skip("root reads every file")
    locked = tmp_path / "locked.png"
    locked.write_bytes(photo.read_bytes())
    locked.chmod(0)
    bpy.context.scene.room_light.photo = str(locked)
    with pytest.raises(RuntimeError, match="locked.png"):
        bpy.ops.room_light.make_room()


def test_own_compositor_is_left_alone(photo):
    scene = bpy.context.scene
    if bpy.app.version >= (5, 0, 0):
        own = scene.compositing_node_group = bpy.data.node_groups.new("own", "CompositorNodeTree")
    else:
        scene.use_nodes = True
        own = scene.node_tree
    nodes = len(own.nodes)
    scene.room_light.photo = str(photo)
    bpy.ops.room_light.make_room()
    assert len(own.nodes) == nodes
    group = scene.room_light.active.room_light.compositing
    assert [item.name for item in group.interface.items_tree] == ["Image", "Image"]
    bpy.ops.room_light.reset()
    current = scene.compositing_node_group if bpy.app.version >= (5, 0, 0) else scene.node_tree
    assert current == own and len(own.nodes) == nodes


def test_cancelled_job_leaves_nothing_behind(photo):
    from bl_ext.user_default.room_light.job import Cancelled, Job, Request

    job = Job(Request(str(photo))).start()
    job.cancel()
    with pytest.raises(Cancelled):
        job.wait()
    assert not job.is_running()


def test_undo_removes_the_room(photo):
    bpy.ops.ed.undo_push(message="before")
    bpy.context.scene.room_light.photo = str(photo)
    bpy.ops.room_light.make_room("EXEC_DEFAULT", True)
    assert bpy.context.scene.room_light.active is not None
    bpy.ops.ed.undo()
    assert "library" not in bpy.data.collections and bpy.context.scene.camera.name == "Camera"
