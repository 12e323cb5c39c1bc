"""What users do to a room: copies, deletions, other sizes, own nodes, odd files and units."""

import bpy
import numpy as np
import pytest
from test_room import named, pixels_of, state

GROUPS = bpy.app.version >= (5, 0, 0)
MADE = "room_light_made"


def compositor():
    scene = bpy.context.scene
    return scene.compositing_node_group if GROUPS else scene.node_tree


def node_that(purpose):
    return next(node for node in compositor().nodes if node.get(MADE) == purpose)


def new_room(photo, **settings):
    scene = bpy.context.scene
    scene.room_light.photo = str(photo)
    for name, value in settings.items():
        setattr(scene.room_light, name, value)
    assert bpy.ops.room_light.make_room() == {"FINISHED"}
    return scene.room_light.active


def made():
    """The names of all data that were made for rooms."""
    kinds = (bpy.data.scenes, bpy.data.worlds, bpy.data.node_groups, bpy.data.images)
    return [block.name for kind in kinds for block in kind if MADE in block]


def test_the_scene_of_the_empty_room_cannot_be_reset(room):
    bpy.context.window.scene = room.room_light.empty
    assert not bpy.ops.room_light.reset.poll() and not bpy.ops.room_light.make_room.poll()
    assert not bpy.ops.room_light.use_room.poll()


def test_nodes_of_a_compositor_that_is_off_stay(photo):
    if GROUPS:
        pytest.skip("since 5.0 a compositor is on or absent")
    scene = bpy.context.scene
    scene.use_nodes = True
    own = scene.node_tree.nodes.new("CompositorNodeGlare")
    scene.use_nodes = False
    scene.render.use_compositing = False
    new_room(photo)
    assert own.name in scene.node_tree.nodes and not scene.use_nodes and not scene.render.use_compositing
    bpy.ops.room_light.reset()
    assert own.name in scene.node_tree.nodes and not scene.use_nodes


def test_a_compositor_that_was_never_changed_is_used_and_left_plain(photo):
    if GROUPS:
        pytest.skip("since 5.0 a compositor is on or absent")
    scene = bpy.context.scene
    scene.use_nodes = True
    scene.use_nodes = False
    scene.render.use_compositing = False
    for _ in range(2):
        new_room(photo)
        assert scene.use_nodes and scene.render.use_compositing and node_that("over")
        bpy.ops.room_light.reset()
        kinds = sorted(node.bl_idname for node in scene.node_tree.nodes)
        assert kinds == ["CompositorNodeComposite", "CompositorNodeRLayers"] and len(scene.node_tree.links) == 1
        assert not scene.use_nodes and not scene.render.use_compositing


def test_own_nodes_in_the_rooms_compositor_stay(room):
    scene, tree = bpy.context.scene, compositor()
    glare = tree.nodes.new("CompositorNodeGlare")
    tree.links.new(node_that("over").outputs[0], glare.inputs["Image"])
    tree.links.new(glare.outputs["Image"], node_that("output").inputs[0])
    for engine in ("CYCLES", scene.render.engine):
        scene.render.engine = engine
        bpy.ops.room_light.use_room()
        assert glare.inputs["Image"].links[0].from_node == node_that("over")
        assert node_that("output").inputs[0].links[0].from_node == glare
    layers = sum(node.bl_idname == "CompositorNodeRLayers" for node in tree.nodes)
    assert layers == 3, "the scene, its objects, the empty room"
    bpy.ops.room_light.reset()
    assert compositor() == tree and glare.inputs["Image"].links[0].from_node.bl_idname == "CompositorNodeRLayers"
    assert made() == [] and not any(MADE in node for node in tree.nodes)


def test_a_copy_of_a_room_can_be_removed(room):
    bpy.ops.room_light.light_object()
    for remove_copy in (True, False):
        copy = copy_collection(room)
        assert copy.room_light.is_room
        bpy.ops.room_light.use_room(room=copy.name)
        removed, left = (copy, room) if remove_copy else (room, copy)
        bpy.ops.room_light.reset(room=removed.name)
        bpy.ops.room_light.use_room(room=left.name)
        properties = left.room_light
        assert properties.world and properties.photo and properties.shading and properties.empty
        assert bpy.context.scene.camera == named(left, "Camera") and bpy.context.scene.world == properties.world
        assert list(properties.empty.collection.children) == [left]
        bpy.ops.room_light.light_object()
        room = left
    bpy.ops.room_light.reset()
    assert made() == []


def copy_collection(collection):
    """As the outliner's Duplicate Collection, which needs a window."""
    copy = collection.copy()
    bpy.context.scene.collection.children.link(copy)
    copies = {thing: thing.copy() for thing in collection.objects}
    for thing, twin in copies.items():
        copy.objects.unlink(thing)
        copy.objects.link(twin)
        twin.parent = copies.get(thing.parent)
    return copy


@pytest.mark.parametrize("kind", ["LINK_COPY", "FULL_COPY"])
def test_copies_of_the_scene_keep_their_room(room, kind):
    first = bpy.context.scene
    bpy.ops.scene.new(type=kind)
    second = bpy.context.scene
    assert second != first and bpy.ops.room_light.reset() == {"FINISHED"}
    assert second.camera.name.startswith("Camera")
    bpy.context.window.scene = first
    assert first.camera == named(room, "Camera") and first.world == room.room_light.world
    bpy.ops.room_light.use_room()
    bpy.ops.room_light.light_object()
    assert bpy.ops.room_light.reset() == {"FINISHED"}
    assert first.camera.name == "Camera" and made() == []


def test_collections_and_children_of_the_user_stay(room):
    cube = bpy.data.objects["Cube"]
    own = bpy.data.collections.new("own")
    room.children.link(own)
    cube.users_collection[0].objects.unlink(cube)
    own.objects.link(cube)
    cube.parent = named(room, "Scene")
    cube.parent.location = (1, 2, 3)
    bpy.context.view_layer.update()
    place = cube.matrix_world.copy()
    bpy.ops.room_light.reset()
    bpy.context.view_layer.update()
    assert "Cube" in bpy.context.scene.objects and cube.users_collection == (own,)
    assert cube.parent is None and np.allclose(cube.matrix_world, place, atol=1e-6)


def test_excluded_collections_are_excluded_from_the_objects(room):
    scene = bpy.context.scene
    outer, inner = bpy.data.collections.new("outer"), bpy.data.collections.new("inner")
    scene.collection.children.link(outer)
    outer.children.link(inner)
    own = bpy.context.view_layer.layer_collection.children["outer"]
    own.children["inner"].exclude = True
    from bl_ext.user_default.room_light import look

    assert not look.is_current(scene, room)
    bpy.ops.room_light.use_room()
    objects = scene.view_layers["Room Light Objects"].layer_collection.children
    assert look.is_current(scene, room)
    assert (objects["outer"].exclude, objects["outer"].children["inner"].exclude) == (False, True)
    assert objects[room.name].holdout
    own.exclude = True
    bpy.ops.room_light.use_room()
    assert objects["outer"].exclude and look.is_current(scene, room)


@pytest.mark.parametrize("size", [(64, 48), (64, 32), (48, 48)])
def test_photo_is_not_stretched_to_other_sizes(room, size, tmp_path):
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    scene.cycles.samples, scene.cycles.use_denoising = 1, False
    for thing in [thing for thing in scene.objects if thing.type == "MESH"]:
        thing.hide_render = True
    scene.render.resolution_x, scene.render.resolution_y = size
    bpy.ops.room_light.use_room()
    assert (scene.render.resolution_x, scene.render.resolution_y) == size
    scene.render.filepath = str(tmp_path / "out.exr")
    scene.render.image_settings.file_format = "OPEN_EXR"
    bpy.ops.render.render(write_still=True)
    found = pixels_of(bpy.data.images.load(scene.render.filepath))[..., :3]
    photo = np.where(
        (encoded := pixels_of(room.room_light.photo)[..., :3]) <= 0.04045,
        encoded / 12.92,
        ((encoded + 0.055) / 1.055) ** 2.4,
    )
    # The camera's width is the photo's.
    block = photo.shape[1] / size[0]
    rows = int(size[1] * block)
    cut = (photo.shape[0] - rows) // 2
    visible = photo[max(cut, 0) : max(cut, 0) + min(rows, photo.shape[0])]
    expected = visible.mean((0, 1))
    inner = found if cut >= 0 else found[round(-cut / block) : size[1] - round(-cut / block)]
    assert inner.mean((0, 1)) == pytest.approx(expected, rel=0.05)
    left, right = (picture[:, : picture.shape[1] // 4].mean((0, 1)) for picture in (inner, visible))
    assert left == pytest.approx(right, rel=0.08)
    top, bottom = (picture[-picture.shape[0] // 4 :].mean((0, 1)) for picture in (inner, visible))
    assert top == pytest.approx(bottom, rel=0.08)


def test_undo_restores_the_former_panorama(room):
    bpy.ops.ed.undo_push(message="room")
    cube = bpy.data.objects["Cube"]
    cube.scale = (0.1, 0.1, 0.1)
    pictures = []
    for place in ((0.2, 1.6, 0.4), (-0.5, 2.5, 0.3)):
        bpy.data.objects["Cube"].location = place
        bpy.context.view_layer.update()
        bpy.context.view_layer.objects.active = bpy.data.objects["Cube"]
        bpy.ops.room_light.light_object("EXEC_DEFAULT", True)
        pictures.append(pixels_of(panorama()))
    assert not np.array_equal(*pictures)
    bpy.ops.ed.undo()
    assert np.array_equal(pixels_of(panorama()), pictures[0]) and panorama().name == "Light of Cube"


def panorama():
    return bpy.context.scene.world.node_tree.nodes["Environment Texture"].image


def test_unit_of_the_scene_is_the_rooms(photo, depth):
    lamps = {}
    for unit in (1.0, 0.01):
        bpy.context.scene.unit_settings.scale_length = unit
        room = new_room(photo, depth=str(depth), hfov_deg=71.7)
        height = named(room, "Camera").matrix_world.translation.z * unit
        assert 0.8 < height < 2.2
        lamps[unit] = [(thing.data.energy, thing.matrix_world.to_scale().x) for thing in room.objects if thing.type == "LIGHT"]
        assert named(room, "Camera").data.clip_end * unit > 50
        bpy.ops.room_light.reset()
    # The same irradiance at a hundred times the distance.
    assert [energy for energy, _ in lamps[0.01]] == pytest.approx([1e4 * energy for energy, _ in lamps[1.0]])
    assert [scale for _, scale in lamps[0.01]] == pytest.approx([100 * scale for _, scale in lamps[1.0]])


@pytest.mark.parametrize("name", ["world", "compositing", "shading", "empty"])
def test_deleted_data_are_made_again(room, name):
    block = getattr(room.room_light, name)
    if name == "empty":
        bpy.data.scenes.remove(block)
    else:
        bpy.data.batch_remove([block])
    bpy.ops.room_light.use_room()
    bpy.ops.room_light.light_object()
    assert getattr(room.room_light, name) is not None
    assert bpy.context.scene.world == room.room_light.world and node_that("over").node_tree == room.room_light.shading
    assert bpy.ops.room_light.reset() == {"FINISHED"} and made() == []


@pytest.mark.parametrize("what", ["photo", "Camera", "World"])
def test_deleted_parts_are_named(room, what):
    thing = room.room_light.photo if what == "photo" else named(room, what)
    bpy.data.batch_remove([thing])
    operator = bpy.ops.room_light.light_object if what == "World" else bpy.ops.room_light.use_room
    with pytest.raises(RuntimeError, match=f"{what}.*was deleted. Make the room again"):
        operator()
    assert bpy.ops.room_light.reset() == {"FINISHED"} and made() == []
    assert bpy.context.scene.camera.name == "Camera"


def test_world_whose_nodes_were_deleted_is_repaired(room):
    room.room_light.world.node_tree.nodes.clear()
    bpy.ops.room_light.light_object()
    assert panorama() is not None
    assert room.room_light.world.node_tree.nodes["Background"].inputs["Strength"].default_value == 1.0


def test_scene_is_restored_after_the_collection_was_deleted_by_hand(photo):
    before = state()
    room = new_room(photo)
    for thing in list(room.objects):
        bpy.data.objects.remove(thing)
    bpy.data.collections.remove(room)
    assert bpy.ops.room_light.reset() == {"FINISHED"}
    after = state()
    # Textures without user are purged by Blender when the file is saved.
    del before["blocks"]["images"], after["blocks"]["images"]
    assert after == before and made() == [] and not bpy.ops.room_light.reset.poll()


def test_paths_relative_to_the_file(photo, tmp_path):
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "room.blend"))
    (tmp_path / "library.png").write_bytes(photo.read_bytes())
    assert new_room("//library.png").name == "library"


def test_long_names(photo, tmp_path):
    file = tmp_path / f"{'ä' * 100}.png"
    file.write_bytes(photo.read_bytes())
    room = new_room(file)
    assert room.name == "ä" * 20 and named(room, "ShadowCatcher").name == f"{room.name} ShadowCatcher"
    assert bpy.ops.room_light.reset(room=room.name) == {"FINISHED"}


def test_folder_is_not_a_photo(tmp_path):
    bpy.context.scene.room_light.photo = str(tmp_path)
    with pytest.raises(RuntimeError, match="is a folder, not a file"):
        bpy.ops.room_light.make_room()
