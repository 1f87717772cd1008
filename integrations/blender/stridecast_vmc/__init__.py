"""Shows characters in Blender that are sent by the VMC protocol, as ``stridecast walk --vmc`` does."""

from __future__ import annotations

import bpy

from . import figure as figures
from .listener import Listener

bl_info = {
    "name": "Stridecast live (VMC)",
    "author": "The stridecast authors",
    "version": (0, 1, 0),
    "blender": (4, 2, 0),
    "location": "3D View > Sidebar > Stridecast",
    "description": "Shows characters that are sent by the VMC protocol as they walk",
    "category": "Animation",
}

EVERY = 1 / 60
"""So often the socket is looked at, seconds."""

_state: dict = {"listener": None, "began": None}


class Settings(bpy.types.PropertyGroup):
    """What the user has chosen."""

    host: bpy.props.StringProperty(
        name="Host", default="127.0.0.1", description="Address to listen at; 0.0.0.0 hears other machines too"
    )
    port: bpy.props.IntProperty(name="Port", default=39539, min=0, max=65535)
    figure: bpy.props.PointerProperty(
        name="Armature",
        type=bpy.types.Object,
        poll=lambda _self, it: it.type == "ARMATURE",
        description="In a T-pose, its bones called as Unity's; one is made if there is none",
    )
    record: bpy.props.BoolProperty(name="Record", description="Insert keys as it comes")


def start(host: str, port: int) -> Listener:
    """Listen from now on; an earlier listener ends.

    Raises
    ------
    OSError
        The port is taken.
    """
    stop()
    _state["listener"], _state["began"] = Listener(host, port), None
    if not bpy.app.timers.is_registered(_tick):
        bpy.app.timers.register(_tick, first_interval=EVERY, persistent=True)
    return _state["listener"]


def stop() -> None:
    """Stop listening."""
    if _state["listener"] is not None:
        _state["listener"].close()
    _state["listener"] = None
    if bpy.app.timers.is_registered(_tick):
        bpy.app.timers.unregister(_tick)


def update() -> bool:
    """Show the newest pose that has come; whether one has."""
    listener = _state["listener"]
    came = None if listener is None else listener.poll()
    if came is None:
        return False
    pose, time = came
    scene = bpy.context.scene
    settings = scene.stridecast_vmc
    if settings.figure is None:
        settings.figure = figures.make(pose)
        settings.figure["stridecast_vmc"] = True
    if _state["began"] is None or time < _state["began"][0]:
        _state["began"] = (time, scene.frame_current)
    began, first = _state["began"]
    rate = scene.render.fps / scene.render.fps_base
    figures.show(settings.figure, pose, frame=first + (time - began) * rate if settings.record else None)
    return True


def _tick() -> float | None:
    if _state["listener"] is None:
        return None
    update()
    return EVERY


class STRIDECAST_OT_start(bpy.types.Operator):
    """Listen for poses."""

    bl_idname = "stridecast.start"
    bl_label = "Listen"

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Start."""
        settings = context.scene.stridecast_vmc
        try:
            start(settings.host, settings.port)
        except OSError as error:
            self.report({"ERROR"}, f"cannot listen at {settings.host}:{settings.port}: {error.strerror or error}")
            return {"CANCELLED"}
        return {"FINISHED"}


class STRIDECAST_OT_stop(bpy.types.Operator):
    """Listen no more."""

    bl_idname = "stridecast.stop"
    bl_label = "Stop"

    def execute(self, context: bpy.types.Context) -> set[str]:  # noqa: ARG002
        """Stop."""
        stop()
        return {"FINISHED"}


class STRIDECAST_PT_panel(bpy.types.Panel):
    """Where it is switched on."""

    bl_label = "Stridecast live"
    bl_idname = "STRIDECAST_PT_panel"
    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"
    bl_category = "Stridecast"

    def draw(self, context: bpy.types.Context) -> None:
        """Draw the panel."""
        settings, listener = context.scene.stridecast_vmc, _state["listener"]
        column = self.layout.column()
        column.enabled = listener is None
        column.prop(settings, "host")
        column.prop(settings, "port")
        self.layout.prop(settings, "figure")
        self.layout.prop(settings, "record")
        if listener is None:
            self.layout.operator("stridecast.start", icon="PLAY")
        else:
            self.layout.operator("stridecast.stop", icon="PAUSE")
            self.layout.label(
                text=f"{listener.frames} poses" + (f", {listener.refused} broken" * bool(listener.refused))
            )


CLASSES = (Settings, STRIDECAST_OT_start, STRIDECAST_OT_stop, STRIDECAST_PT_panel)


def register() -> None:
    """Switch the add-on on."""
    for kind in CLASSES:
        bpy.utils.register_class(kind)
    bpy.types.Scene.stridecast_vmc = bpy.props.PointerProperty(type=Settings)


def unregister() -> None:
    """Switch it off."""
    stop()
    del bpy.types.Scene.stridecast_vmc
    for kind in reversed(CLASSES):
        bpy.utils.unregister_class(kind)
