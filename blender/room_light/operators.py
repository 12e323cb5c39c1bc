"""What the buttons of the panel do."""

import os

import bpy
import lightoctree
from bpy.props import StringProperty

from . import build, lighting, look
from .job import Cancelled, Job, Request
from .names import ROLE, MissingPart, is_empty_room, rooms

# Interval at which the status bar is updated, in seconds.
INTERVAL_S = 0.1
running = None


def cancel_job():
    """Cancels the running job, if there is one."""
    if running is not None:
        running.cancel()


class MakeRoom(bpy.types.Operator):
    """Estimate the light of the photo's room, and add its camera, surfaces and lamps to the scene"""

    bl_idname = "room_light.make_room"
    bl_label = "Make Room"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context):
        if running is not None:
            cls.poll_message_set("A room is being estimated")
            return False
        if is_empty_room(context.scene):
            cls.poll_message_set("This scene belongs to the shadows of EEVEE: return to your own")
            return False
        if context.mode != "OBJECT":
            cls.poll_message_set("Leave edit mode first")
            return False
        return True

    def execute(self, context):
        """Waits for the result; for scripts and Blender without a window."""
        try:
            request = request_of(context.scene.room_light)
        except ValueError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        return self.finish(context, Job(request).start())

    def invoke(self, context, _event):
        global running
        if bpy.app.background:
            return self.execute(context)
        try:
            request = request_of(context.scene.room_light)
        except ValueError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        running = self.job = Job(request).start()
        manager = context.window_manager
        manager.progress_begin(0, 100)
        self.timer = manager.event_timer_add(INTERVAL_S, window=context.window)
        manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def modal(self, context, event):
        if event.type == "ESC" and event.value == "PRESS":
            self.job.cancel()
            return {"RUNNING_MODAL"}
        if event.type != "TIMER":
            return {"PASS_THROUGH"}
        if self.job.is_running():
            percent = round(100 * self.job.share)
            context.window_manager.progress_update(percent)
            progress = f" {percent} %" if percent else ""
            context.workspace.status_text_set(f"Room Light: {self.job.stage}{progress}    Esc: cancel")
            return {"RUNNING_MODAL"}
        return self.end(context)

    def cancel(self, context):
        self.job.cancel()
        self.end(context)

    def end(self, context):
        global running
        manager = context.window_manager
        manager.event_timer_remove(self.timer)
        manager.progress_end()
        context.workspace.status_text_set(None)
        job, running = self.job, None
        return self.finish(context, job)

    def finish(self, context, job):
        """Builds the room of a job."""
        try:
            room = job.wait()
        except Cancelled:
            self.report({"INFO"}, "Cancelled")
            return {"CANCELLED"}
        except Exception as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        with room.folder:
            collection = build.build(context, room)
        messages = room.warnings + look.activate(context.scene, collection)
        if not room.is_level:
            messages.append("The direction of gravity is unknown: the room stands as the camera does")
        if context.scene.render.engine != "CYCLES":
            messages += lighting.light_view(collection)
        for message in messages:
            self.report({"WARNING"}, message)
        return {"FINISHED"}


class RoomOperator:
    """An operator on a room of the scene: the named one, else the active one."""

    bl_options = {"REGISTER", "UNDO"}
    room: StringProperty(options={"HIDDEN", "SKIP_SAVE"})

    @classmethod
    def poll(cls, context):
        return bool(rooms(context.scene))

    def execute(self, context):
        present = rooms(context.scene)
        collection = next((room for room in present if room.name == self.room), None)
        if self.room and collection is None:
            self.report({"ERROR"}, f"The scene has no room {self.room!r}")
            return {"CANCELLED"}
        if collection is None:
            active = context.scene.room_light.active
            collection = active if active in present else present[0]
        try:
            messages = self.execute_on(context, collection)
        except (MissingPart, ValueError, lightoctree.LightOctreeError) as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        for message in messages:
            self.report({"WARNING"}, message)
        return {"FINISHED"}


class LightObject(RoomOperator, bpy.types.Operator):
    """Light the scene by the panorama at the active object. Use it again after moving the object"""

    bl_idname = "room_light.light_object"
    bl_label = "Light for Object"

    @classmethod
    def poll(cls, context):
        target = context.active_object
        if target is None or ROLE in target:
            cls.poll_message_set("Select an object that is not part of a room")
            return False
        return bool(rooms(context.scene))

    def execute_on(self, context, collection):
        messages = lighting.light_object(collection, context.active_object)
        scene = context.scene
        if scene.world is None and scene.room_light.active == collection:
            scene.world = lighting.world_of(collection)
        return messages


class UseRoom(RoomOperator, bpy.types.Operator):
    """Render the scene in this room, and hide the others. On the room in use, bring its set-up up to date"""

    bl_idname = "room_light.use_room"
    bl_label = "Use Room"

    def execute_on(self, context, collection):
        return look.activate(context.scene, collection)


class ResetRoom(RoomOperator, bpy.types.Operator):
    """Remove the room, and restore the scene's settings with the last one"""

    bl_idname = "room_light.reset"
    bl_label = "Reset"

    @classmethod
    def poll(cls, context):
        scene = context.scene
        # Without rooms if the user deleted them by hand.
        return bool(rooms(scene) or scene.room_light.before) and not is_empty_room(scene)

    def execute(self, context):
        scene = context.scene
        if rooms(scene):
            return super().execute(context)
        look.restore(scene)
        build.sweep()
        return {"FINISHED"}

    def execute_on(self, context, collection):
        scene = context.scene
        build.check_removable(scene, collection)
        others = [room for room in rooms(scene) if room != collection]
        if not others:
            look.restore(scene)
        build.remove(scene, collection)
        if others and scene.room_light.active not in others:
            return look.activate(scene, others[0])
        return []


def request_of(settings):
    """The request of the panel's settings.

    Raises ValueError if a file is missing.
    """
    files = {}
    for name in ("photo", "depth", "panorama"):
        path = getattr(settings, name)
        files[name] = os.path.abspath(bpy.path.abspath(path)) if path else ""
        if os.path.isdir(files[name]):
            raise ValueError(f"{files[name]}: is a folder, not a file")
        if path and not os.path.isfile(files[name]):
            raise ValueError(f"{files[name]}: no such file")
    if not files["photo"]:
        raise ValueError("Choose a photo")
    return Request(**files, depth_is=settings.depth_is, hfov_deg=settings.hfov_deg, light=settings.light)


CLASSES = [MakeRoom, LightObject, UseRoom, ResetRoom]
