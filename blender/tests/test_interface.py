"""The panel and the modal operator, which Blender without window does not run by itself."""

import time
from types import SimpleNamespace

import bpy
from bl_ext.user_default.room_light import operators, panel


class Layout:
    """Records what a panel shows, and refuses properties and operators that do not exist."""

    def __init__(self, shown=None):
        self.shown = [] if shown is None else shown

    def prop(self, data, name, **_):
        assert name in data.bl_rna.properties, name
        self.shown.append(name)

    def operator(self, name, text="", **_):
        module, function = name.split(".")
        kind = getattr(getattr(bpy.ops, module), function).get_rna_type()
        self.shown.append(text or kind.name)
        return SimpleNamespace()

    def label(self, text, **_):
        self.shown.append(text)

    def row(self):
        return Layout(self.shown)

    box = row

    def panel(self, _name, default_closed):
        assert default_closed
        return Layout(self.shown), Layout(self.shown)


def shown():
    layout = Layout()
    panel.RoomLightPanel.draw(SimpleNamespace(layout=layout), bpy.context)
    return layout.shown


def test_panel_without_rooms():
    assert shown() == ["photo", "Depth, Panorama, Lens", "depth", "panorama", "hfov_deg", "light", "Make Room"]


def test_panel_with_a_room(room):
    # A new file renders by EEVEE.
    assert shown()[-5:] == ["Make Room", "library", "Reset", "source", "Light for Cube"]
    room.room_light.source = "ROOM"
    assert shown()[-1] == "The room lights in Cycles only"
    bpy.ops.room_light.light_object()
    assert shown()[-1] == "Environment at Cube"
    bpy.context.scene.render.engine = "CYCLES"
    assert shown()[-1] == "Update for Cycles"
    bpy.ops.room_light.use_room()
    assert shown()[-1] == "Environment at Cube"
    bpy.context.view_layer.objects.active = bpy.data.objects["library Camera"]
    assert "Light for Object" in shown() and not bpy.ops.room_light.light_object.poll()


class Screen:
    """A window's context; everything that is not here is Blender's."""

    def __init__(self):
        self.text = []
        self.workspace = SimpleNamespace(status_text_set=self.text.append)
        names = ("progress_begin", "progress_update", "progress_end", "event_timer_remove", "modal_handler_add")
        self.window_manager = SimpleNamespace(**dict.fromkeys(names, lambda *_: None))
        self.window_manager.event_timer_add = lambda *_, **__: None

    def __getattr__(self, name):
        return getattr(bpy.context, name)


class Operator:
    """The operator's own functions on a plain object."""

    def __init__(self, job):
        self.job, self.timer, self.reports = job, None, []
        operators.running = job

    def report(self, kinds, text):
        self.reports.append((*kinds, text))

    def __getattr__(self, name):
        return getattr(operators.MakeRoom, name).__get__(self)


def until_done(operator, screen, event):
    for _ in range(3000):
        result = operator.modal(screen, event)
        if result != {"RUNNING_MODAL"}:
            return result
        time.sleep(0.02)
    raise AssertionError("the job does not end")


def test_job_shows_its_stages_and_builds_the_room(photo, depth):
    screen, request = Screen(), operators.Request(str(photo), str(depth))
    operator = Operator(operators.Job(request).start())
    assert not bpy.ops.room_light.make_room.poll(), "one job at a time"
    assert operator.modal(screen, SimpleNamespace(type="MOUSEMOVE", value="NOTHING")) == {"PASS_THROUGH"}
    assert until_done(operator, screen, SimpleNamespace(type="TIMER", value="NOTHING")) == {"FINISHED"}
    assert any("Esc: cancel" in text for text in screen.text if text) and screen.text[-1] is None
    assert bpy.context.scene.room_light.active.name == "library"
    assert operators.running is None


def test_escape_cancels(photo):
    screen = Screen()
    operator = Operator(operators.Job(operators.Request(str(photo))).start())
    operator.modal(screen, SimpleNamespace(type="ESC", value="PRESS"))
    started = time.monotonic()
    assert until_done(operator, screen, SimpleNamespace(type="TIMER", value="NOTHING")) == {"CANCELLED"}
    assert operator.reports == [("INFO", "Cancelled")] and time.monotonic() - started < 20
    assert "library" not in bpy.data.collections and screen.text[-1] is None
