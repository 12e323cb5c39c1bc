"""A collection of Blender objects from an estimated room."""

import bpy

from . import compositing, lighting
from .names import ROLE, SCENE

# What the objects of an exported room are for, by their names in the file.
ROLES = ("Scene", "World", "Camera", "Room", "Photo", "Lamp", "ShadowCatcher", "Backdrop", "Materials")
# Blender reads a distant light four times as strong as USD defines it.
SUN_SCALE = 0.25


def build(context, room):
    """Imports the room into a new collection of the scene and returns it."""
    collection = bpy.data.collections.new(room.name)
    context.scene.collection.children.link(collection)
    try:
        objects = imported(context, collection, room.usd)
        fill(collection, objects, room)
    except Exception:
        remove(collection)
        raise
    return collection


def imported(context, collection, usd):
    """Imports a file into a collection; the selection and the active collection stay as they are."""
    layer = context.view_layer
    active_layer, active, selected = layer.active_layer_collection, layer.objects.active, context.selected_objects
    known = set(bpy.data.objects)
    images = set(bpy.data.images)
    layer.active_layer_collection = layer_collection(layer.layer_collection, collection)
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


def layer_collection(within, collection):
    """The view layer's entry of a collection."""
    if within.collection == collection:
        return within
    found = (layer_collection(child, collection) for child in within.children)
    return next((child for child in found if child is not None), None)


def fill(collection, objects, room):
    """Sets what USD cannot store: names, visibility, the photo behind the camera, the room's file."""
    made = {}
    for thing in objects:
        role = next(role for role in ROLES if thing.name.startswith(role))
        made.setdefault(role, []).append(thing)
    [backdrop], [folder] = made.pop("Backdrop"), made.pop("Materials")
    photo = image_of(backdrop)
    photo.name = room.name
    discard(backdrop)
    bpy.data.objects.remove(folder)
    for role, things in made.items():
        for thing in things:
            thing[ROLE] = role
            thing.name = f"{room.name} {thing.name.split('.')[0]}"
            for slot in thing.material_slots:
                slot.material.name = f"{room.name} {slot.material.name.split('.')[0]}"
    [camera], [root] = made["Camera"], made["World"]
    show_behind(camera.data, photo)
    prepare_surfaces(made)
    for lamp in made.get("Lamp", []):
        lamp.data.name = lamp.name
        if lamp.data.type == "SUN":
            lamp.data.energy *= SUN_SCALE
    collection[SCENE] = room.scene.to_bytes()
    properties = collection.room_light
    properties.is_room = True
    properties.is_level = room.is_level
    properties.root, properties.camera, properties.photo = root, camera, photo
    properties.inferred = room.light
    properties.world = lighting.new_world(room.name)
    properties.compositing = compositing.over_photo(room.name, photo)
    properties.shading = compositing.shaded_photo(room.name, photo)


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


def remove(collection):
    """Removes a room with all that it consists of. Objects that the user put into its collection stay in the scene."""
    room = collection.room_light
    extra = [room.empty, room.world, room.compositing, room.shading]
    images = {room.photo} if room.photo else set()
    if room.world is not None:
        images |= lighting.images(room.world)
    made = []
    for thing in list(collection.all_objects):
        if ROLE in thing:
            made.append(thing)
            images |= {slot_image for slot_image in images_of(thing)}
        else:
            for scene in thing.users_scene:
                if thing.name not in scene.collection.objects:
                    scene.collection.objects.link(thing)
    blocks = [(thing.data, [slot.material for slot in thing.material_slots]) for thing in made]
    bpy.data.batch_remove(made)
    materials = {material for _, used in blocks for material in used if material is not None}
    unused = [data for data in {data for data, _ in blocks if data is not None} if data.users == 0]
    bpy.data.batch_remove(unused)
    bpy.data.batch_remove([material for material in materials if material.users == 0])
    bpy.data.collections.remove(collection)
    bpy.data.batch_remove([block for block in extra if block is not None])
    bpy.data.batch_remove([image for image in images if image.users == 0])


def images_of(thing):
    for slot in thing.material_slots:
        if slot.material is not None and slot.material.node_tree is not None:
            yield from (node.image for node in slot.material.node_tree.nodes if node.type == "TEX_IMAGE" and node.image)


def rooms(scene):
    """The collections of the scene's rooms."""
    return [collection for collection in scene.collection.children_recursive if collection.room_light.is_room]
