"""Renders that EEVEE needs for shadows on the photo: the objects alone, and the room without objects.

The room without objects is a scene of its own, since objects of the scene's main collection are in all view layers.
"""

import bpy

from .names import MADE, ROOM, part
from .lighting import world_of

OBJECTS = "Room Light Objects"
# Of collections in a view layer.
VISIBILITY = ("exclude", "holdout", "indirect_only")


def prepare(scene, collection):
    """Adds the view layer of the objects and the scene of the empty room, or brings them up to date."""
    room = collection.room_light
    layer = scene.view_layers.get(OBJECTS) or scene.view_layers.new(OBJECTS)
    layer.use = True
    for own, copy in pairs(scene, layer):
        for name in VISIBILITY:
            setattr(copy, name, getattr(own, name))
    for child in layer_collections(layer.layer_collection):
        if child.collection == collection:
            child.holdout = True
    # That of a copied room is the original's.
    if room.empty is None or list(room.empty.collection.children) != [collection]:
        room.empty = bpy.data.scenes.new(f"{collection.name} Empty")
        room.empty[MADE] = ROOM
        room.empty.collection.children.link(collection)
    bare = room.empty
    bare.camera, bare.world, bare.render.engine = part(collection, "Camera"), world_of(collection), scene.render.engine
    bare.render.film_transparent, bare.render.use_compositing = True, False
    for setting in scene.eevee.bl_rna.properties:
        if not setting.is_readonly and setting.identifier != "name":
            setattr(bare.eevee, setting.identifier, getattr(scene.eevee, setting.identifier))


def is_prepared(scene, collection):
    """Returns whether nothing that `prepare` reads has changed since, the settings of EEVEE excepted."""
    layer, bare = scene.view_layers.get(OBJECTS), collection.room_light.empty
    if layer is None or bare is None or bare.render.engine != scene.render.engine:
        return False
    return all(
        getattr(own, name) == getattr(copy, name)
        for own, copy in pairs(scene, layer)
        if own.collection != collection
        for name in VISIBILITY
    )


def pairs(scene, layer):
    """Returns the entries of all collections in the scene's own view layer and in another one, parents first."""
    return zip(layer_collections(main_layer(scene).layer_collection), layer_collections(layer.layer_collection))


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
