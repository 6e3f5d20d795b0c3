"""A render engine that renders with the program ppm-vk. docs/blender.md has what it does."""

import bpy

from . import engine, panels, settings

_CLASSES = (*settings.CLASSES, engine.PpmVkRenderEngine, *panels.CLASSES)


def register():
    for cls in _CLASSES:
        bpy.utils.register_class(cls)
    settings.register()
    panels.register()


def unregister():
    panels.unregister()
    settings.unregister()
    for cls in reversed(_CLASSES):
        bpy.utils.unregister_class(cls)
