"""Room Light: the light of a room, from one photo, for objects in Blender."""

import bpy

from . import operators, panel, properties


def register():
    for kind in properties.CLASSES + operators.CLASSES + panel.CLASSES:
        bpy.utils.register_class(kind)
    bpy.types.Scene.room_light = bpy.props.PointerProperty(type=properties.RoomLightSettings)
    bpy.types.Collection.room_light = bpy.props.PointerProperty(type=properties.RoomLightRoom)


def unregister():
    operators.cancel_job()
    del bpy.types.Collection.room_light
    del bpy.types.Scene.room_light
    for kind in reversed(properties.CLASSES + operators.CLASSES + panel.CLASSES):
        bpy.utils.unregister_class(kind)
