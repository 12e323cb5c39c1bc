"""Renders that EEVEE needs for shadows on the photo: the objects alone, and the room without objects.

The room without objects is a scene of its own, since objects of the scene's main collection are in all view layers.
"""

import bpy

OBJECTS = "Room Light Objects"


def prepare(scene, collection):
    """Adds the view layer of the objects and the scene of the empty room, or brings them up to date."""
    room = collection.room_light
    layer = scene.view_layers.get(OBJECTS)
    if layer is None:
        layer = scene.view_layers.new(OBJECTS)
    layer.use = True
    for child in layer_collections(layer.layer_collection):
        if child.collection == collection:
            child.holdout = True
    if room.empty is None:
        room.empty = bpy.data.scenes.new(f"{collection.name} Empty")
        room.empty.collection.children.link(collection)
    bare = room.empty
    bare.camera, bare.world, bare.render.engine = room.camera, room.world, scene.render.engine
    bare.render.film_transparent, bare.render.use_compositing = True, False
    for setting in scene.eevee.bl_rna.properties:
        if not setting.is_readonly and setting.identifier != "name":
            setattr(bare.eevee, setting.identifier, getattr(scene.eevee, setting.identifier))


def leave(scene):
    """Does not render the objects alone any more."""
    layer = scene.view_layers.get(OBJECTS)
    if layer is not None:
        scene.view_layers.remove(layer)


def main_layer(scene):
    """Returns the scene's own view layer."""
    return next(layer for layer in scene.view_layers if layer.name != OBJECTS)


def layer_collections(layer):
    for child in layer.children:
        yield child
        yield from layer_collections(child)
