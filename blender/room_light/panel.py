"""The panel "Room Light" in the sidebar of the 3D view."""

import bpy

from . import look, operators
from .names import ROLE, MissingPart, is_empty_room, rooms


class RoomLightPanel(bpy.types.Panel):
    bl_idname = "VIEW3D_PT_room_light"
    bl_label = "Room Light"
    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"
    bl_category = "Room Light"

    def draw(self, context):
        layout = self.layout
        layout.use_property_split = True
        layout.use_property_decorate = False
        scene = context.scene
        settings = scene.room_light
        if is_empty_room(scene):
            layout.label(text="Scene of the room's shadows in EEVEE", icon="INFO")
            return
        layout.prop(settings, "photo")
        header, body = layout.panel("room_light_more", default_closed=True)
        header.label(text="Depth, Panorama, Lens")
        if body:
            body.prop(settings, "depth")
            if settings.depth:
                body.prop(settings, "depth_is")
            body.prop(settings, "panorama")
            body.prop(settings, "hfov_deg")
            body.prop(settings, "light")
        layout.operator(operators.MakeRoom.bl_idname, icon="LIGHT_AREA")
        found = rooms(scene)
        if settings.before and not found:
            layout.operator(operators.ResetRoom.bl_idname, text="Restore the Scene", icon="LOOP_BACK")
        for collection in found:
            draw_room(context, layout.box(), collection)


def draw_room(context, box, collection):
    room = collection.room_light
    is_active = context.scene.room_light.active == collection
    row = box.row()
    icon = "RADIOBUT_ON" if is_active else "RADIOBUT_OFF"
    row.operator(operators.UseRoom.bl_idname, text=collection.name, icon=icon, emboss=False).room = collection.name
    row.operator(operators.ResetRoom.bl_idname, text="", icon="TRASH").room = collection.name
    if not is_active:
        return
    box.row().prop(room, "source", expand=True)
    target = context.active_object
    text = f"Light for {target.name}" if target and ROLE not in target else "Light for Object"
    box.operator(operators.LightObject.bl_idname, text=text, icon="WORLD").room = collection.name
    is_cycles = context.scene.render.engine == "CYCLES"
    if room.source == "ENVIRONMENT" and room.target is not None:
        box.label(text=f"Environment at {room.target.name}")
    elif room.source == "ROOM" and not is_cycles:
        box.label(text="The room lights in Cycles only", icon="ERROR")
    try:
        is_current = look.is_current(context.scene, collection)
    except MissingPart as error:
        box.label(text=str(error), icon="ERROR")
        return
    if not is_current:
        text = f"Update for {'Cycles' if is_cycles else 'EEVEE'}"
        box.operator(operators.UseRoom.bl_idname, text=text, icon="FILE_REFRESH").room = collection.name


CLASSES = [RoomLightPanel]
