"""Settings of the panel, and what a room's collection knows of its room."""

import bpy
from bpy.props import BoolProperty, EnumProperty, FloatProperty, PointerProperty, StringProperty

from . import lighting

FILE = {"subtype": "FILE_PATH", "options": {"PATH_SUPPORTS_BLEND_RELATIVE"}}


class RoomLightRoom(bpy.types.PropertyGroup):
    """A room that was made of a photo; stored with its collection."""

    is_room: BoolProperty()
    photo: PointerProperty(type=bpy.types.Image)
    world: PointerProperty(type=bpy.types.World)
    compositing: PointerProperty(type=bpy.types.NodeTree)
    shading: PointerProperty(type=bpy.types.NodeTree)
    empty: PointerProperty(type=bpy.types.Scene)
    inferred: StringProperty()
    target: PointerProperty(
        type=bpy.types.Object,
        name="Object",
        description="The object at whose position the environment is rendered",
    )
    source: EnumProperty(
        name="Light From",
        items=[
            ("ROOM", "Room", "The room's surfaces and lamps light objects wherever they are. Cycles only"),
            ("ENVIRONMENT", "Environment", "The panorama at one object lights the scene. Cycles and EEVEE"),
        ],
        update=lambda room, context: lighting.show_source(room.id_data),
    )


class RoomLightSettings(bpy.types.PropertyGroup):
    """Inputs of the next room, and what the scene was before its rooms."""

    photo: StringProperty(
        name="Photo", description="Photo of the room, or a .scene file of lightoctree", **FILE
    )
    depth: StringProperty(name="Depth", description="Depth map of the photo; optional", **FILE)
    depth_is: EnumProperty(
        name="Depth Is",
        items=[
            ("measured", "Measured", "By a sensor, in metres or millimetres"),
            ("predicted", "Predicted", "By a depth network"),
            ("inverse", "Inverse", "Disparity or inverse depth of any scale"),
        ],
    )
    panorama: StringProperty(name="Panorama", description="HDR panorama of the same room; optional", **FILE)
    hfov_deg: FloatProperty(
        name="Field of View",
        description="Horizontal field of view of the photo in degrees; 0: from the file, else estimated",
        min=0.0,
        max=170.0,
        precision=1,
    )
    light: EnumProperty(
        name="Unseen Light",
        description="Light of the parts of the room that the photo does not show",
        items=[
            ("plausible", "Plausible", "Gathered into lamps; objects have the contrast of real rooms"),
            ("expected", "Expected", "Mean of what is likely; soft"),
            ("even", "Even", "As the octree has it; nearly without direction"),
        ],
    )
    active: PointerProperty(type=bpy.types.Collection)
    before: StringProperty()
    before_camera: PointerProperty(type=bpy.types.Object)
    before_world: PointerProperty(type=bpy.types.World)


CLASSES = [RoomLightRoom, RoomLightSettings]
