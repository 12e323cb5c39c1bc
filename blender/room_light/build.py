"""A collection of Blender objects from an estimated room."""

import bpy

from .empty import layer_collections
from .names import MADE, ROLE, ROOM, SCENE, SHARED, all_rooms, is_empty_room

# What the objects of an exported room are for, by their names in the file.
ROLES = ("Scene", "World", "Camera", "Room", "Photo", "Lamp", "ShadowCatcher", "Backdrop", "Materials")
# Blender reads a distant light four times as strong as USD defines it.
SUN_SCALE = 0.25
# Maximum length of a room's name.
NAME_BYTES = 40


def build(context, room):
    """Imports the room into a new collection of the scene and returns it."""
    scene = context.scene
    collection = bpy.data.collections.new(shortened(room.name))
    scene.collection.children.link(collection)
    try:
        objects = imported(context, collection, room.usd)
        fill(collection, objects, room, 1.0 / scene.unit_settings.scale_length)
    except Exception:
        remove(scene, collection)
        raise
    return collection


def shortened(name):
    """Leaves room for what is appended to a name: Blender cuts names after 63 bytes."""
    return name.encode()[:NAME_BYTES].decode(errors="ignore")


def imported(context, collection, usd):
    """Imports a file into a collection; the selection and the active collection stay as they are."""
    layer = context.view_layer
    active_layer, active, selected = layer.active_layer_collection, layer.objects.active, context.selected_objects
    known = set(bpy.data.objects)
    images = set(bpy.data.images)
    entries = layer_collections(layer.layer_collection)
    layer.active_layer_collection = next(entry for entry in entries if entry.collection == collection)
    try:
        bpy.ops.wm.usd_import(
            filepath=usd,
            set_frame_range=False,
            import_textures_mode="IMPORT_PACK",
            mtl_name_collision_mode="MAKE_UNIQUE",
            create_world_material=False,
        )
    finally:
        layer.active_layer_collection = active_layer
        for thing in context.selected_objects:
            thing.select_set(False)
        for thing in selected:
            thing.select_set(True)
        layer.objects.active = active
    for image in set(bpy.data.images) - images:
        # The temporary folder will be gone.
        if image.packed_file is None:
            image.pack()
        image.filepath = "//" + bpy.path.basename(image.filepath)
    return [thing for thing in bpy.data.objects if thing not in known]


def fill(collection, objects, room, units_per_m):
    """Sets what USD cannot store: names, visibility, the photo behind the camera, the unit, the room's file."""
    name = shortened(room.name)
    made = {}
    for thing in objects:
        role = next(role for role in ROLES if thing.name.startswith(role))
        made.setdefault(role, []).append(thing)
    [backdrop], [folder] = made.pop("Backdrop"), made.pop("Materials")
    photo = image_of(backdrop)
    photo.name, photo[MADE] = name, ROOM
    discard(backdrop)
    bpy.data.objects.remove(folder)
    for role, things in made.items():
        for thing in things:
            thing[ROLE] = role
            thing.name = f"{name} {thing.name.split('.')[0]}"
            if thing.data is not None:
                thing.data[MADE] = ROOM
            for slot in thing.material_slots:
                slot.material.name = f"{name} {slot.material.name.split('.')[0]}"
                slot.material[MADE] = ROOM
    [top], [camera] = made["Scene"], made["Camera"]
    show_behind(camera.data, photo)
    prepare_surfaces(made)
    for lamp in made.get("Lamp", []):
        lamp.data.name = lamp.name
        if lamp.data.type == "SUN":
            lamp.data.energy *= SUN_SCALE
        else:
            # Watts at a distance in units.
            lamp.data.energy *= units_per_m**2
    top.scale = [units_per_m * factor for factor in top.scale]
    camera.data.clip_start *= units_per_m
    camera.data.clip_end *= units_per_m
    collection[SCENE] = room.scene.to_bytes()
    properties = collection.room_light
    properties.is_room = True
    properties.photo = photo
    properties.inferred = room.light


def prepare_surfaces(made):
    surfaces = made["Room"] + made["Photo"]
    [catcher] = made["ShadowCatcher"]
    for thing in [*surfaces, catcher]:
        # Cycles draws what a catcher loses when all other objects come: the room's own light is there before.
        thing.is_shadow_catcher = True
        thing.hide_select = True
        for slot in thing.material_slots:
            material = slot.material
            # Rays find large dim surfaces by themselves; lamps are sampled.
            if hasattr(material, "cycles"):
                material.cycles.emission_sampling = "NONE"
            # Solid view shows the photo behind the camera, and objects snap to the surfaces nevertheless.
            material.diffuse_color = (1.0, 1.0, 1.0, 0.0)
    for thing in surfaces:
        thing.visible_camera = False
        # A sun from outside reaches the objects.
        thing.visible_shadow = not any(lamp.data.type == "SUN" for lamp in made.get("Lamp", []))
    catcher.visible_diffuse = catcher.visible_glossy = False
    catcher.visible_transmission = catcher.visible_shadow = False


def show_behind(camera, photo):
    """Shows the photo as the camera's background."""
    camera.show_background_images = True
    background = camera.background_images.new()
    background.image = photo
    background.alpha = 1.0
    background.frame_method = "FIT"


def image_of(thing):
    """The texture of an object."""
    nodes = thing.material_slots[0].material.node_tree.nodes
    return next(node.image for node in nodes if node.type == "TEX_IMAGE")


def discard(thing):
    """Removes an object with its mesh and materials, but not their images."""
    data, materials = thing.data, [slot.material for slot in thing.material_slots]
    bpy.data.objects.remove(thing)
    if data.users == 0:
        bpy.data.meshes.remove(data)
    for material in materials:
        if material is not None and material.users == 0:
            bpy.data.materials.remove(material)


def remove(scene, collection):
    """Removes a room from a scene, with all that it consists of.

    What the user put into its collection, or made a child of its objects, stays in the scene where it is. A room that
    is in another scene, too, is only unlinked.
    """
    if other_scenes(scene, collection):
        scene.collection.children.unlink(collection)
        return
    made = [thing for thing in collection.objects if ROLE in thing]
    for thing in bpy.data.objects:
        if thing.parent in made and thing not in made:
            place = thing.matrix_world.copy()
            thing.parent = None
            thing.matrix_world = place
    for thing in collection.objects:
        if thing not in made and thing.name not in scene.collection.objects:
            scene.collection.objects.link(thing)
    for child in collection.children:
        if child.name not in scene.collection.children:
            scene.collection.children.link(child)
    images = {image for thing in made for image in images_of(thing)}
    bpy.data.batch_remove(made)
    bpy.data.collections.remove(collection)
    sweep()
    remove_unused(images)


def check_removable(scene, collection):
    """Raises ValueError if removing a room would remove it from another scene, too."""
    others = other_scenes(scene, collection)
    if others and collection.name not in scene.collection.children:
        raise ValueError(f"The room is in the scene {others[0].name!r}, too: remove its collection by hand")


def other_scenes(scene, collection):
    """Returns the other scenes that contain a room."""
    others = (other for other in bpy.data.scenes if other != scene and not is_empty_room(other))
    return [other for other in others if collection in other.collection.children_recursive]


def sweep():
    """Removes what was made for rooms, and to which no room refers any more."""
    needed = {getattr(room.room_light, name) for room in all_rooms() for name in SHARED}
    # Also those whose room the user deleted by hand.
    for scene in [scene for scene in bpy.data.scenes if is_empty_room(scene) and scene not in needed]:
        bpy.data.scenes.remove(scene)
    for blocks in (bpy.data.node_groups, bpy.data.worlds):
        bpy.data.batch_remove([block for block in blocks if block.get(MADE) == ROOM and block not in needed])
    for blocks in (bpy.data.meshes, bpy.data.lights, bpy.data.cameras, bpy.data.materials, bpy.data.images):
        remove_unused(block for block in blocks if block.get(MADE) == ROOM)


def remove_unused(blocks):
    bpy.data.batch_remove([block for block in blocks if block.users == 0])


def images_of(thing):
    for slot in thing.material_slots:
        if slot.material is not None and slot.material.node_tree is not None:
            yield from (node.image for node in slot.material.node_tree.nodes if node.type == "TEX_IMAGE" and node.image)
