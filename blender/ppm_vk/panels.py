"""Panels of the engine's settings, and Blender's own panels that apply to it."""

import bpy

from .engine import PpmVkRenderEngine
from .settings import preferences

_ENGINE = PpmVkRenderEngine.bl_idname

# Of Blender's panels for engines without settings of their own these don't apply.
_WITHOUT_EFFECT = {
    "DATA_PT_light",
    "DATA_PT_camera_stereoscopy",
    "OBJECT_PT_shading",
    "RENDER_PT_freestyle",
    "VIEWLAYER_PT_filter",
    "VIEWLAYER_PT_layer_passes",
    "VIEWLAYER_PT_layer_passes_aov",
    "VIEWLAYER_PT_layer_passes_cryptomatte",
}
# Panels for EEVEE that show what Cycles' show, too.
_OF_EEVEE = {
    "DATA_PT_EEVEE_light",
    "DATA_PT_camera_dof",
    "DATA_PT_camera_dof_aperture",
    "EEVEE_MATERIAL_PT_context_material",
    "EEVEE_MATERIAL_PT_surface",
    "EEVEE_MATERIAL_PT_volume",
    "EEVEE_WORLD_PT_surface",
    "MATERIAL_PT_preview",
    "NODE_DATA_PT_EEVEE_light",
}


class _RenderPanel:
    bl_space_type = "PROPERTIES"
    bl_region_type = "WINDOW"
    bl_context = "render"
    COMPAT_ENGINES = {_ENGINE}

    @classmethod
    def poll(cls, context):
        return context.engine in cls.COMPAT_ENGINES


class _Columns(_RenderPanel):
    properties = ()

    def draw(self, context):
        self.layout.use_property_split = True
        self.layout.use_property_decorate = False
        for name in self.properties:
            self.layout.prop(context.scene.ppm_vk, name)


class PPMVK_PT_sampling(_Columns, bpy.types.Panel):
    bl_label = "Sampling"
    properties = ("iterations", "time", "target_error", "photons", "max_depth", "estimator", "seed", "denoise")


class PPMVK_PT_film(_RenderPanel, bpy.types.Panel):
    bl_label = "Film"

    def draw(self, context):
        self.layout.use_property_split = True
        self.layout.use_property_decorate = False
        self.layout.prop(context.scene.render, "film_transparent", text="Transparent")


class PPMVK_PT_program(_Columns, bpy.types.Panel):
    bl_label = "Program"
    properties = ("device", "save_every", "arguments")

    def draw(self, context):
        super().draw(context)
        of_addon = preferences()
        if of_addon:
            self.layout.prop(of_addon, "program")


CLASSES = (PPMVK_PT_sampling, PPMVK_PT_film, PPMVK_PT_program)


def _panels():
    for panel in bpy.types.Panel.__subclasses__():
        engines = getattr(panel, "COMPAT_ENGINES", ())
        name = panel.__name__
        if name in _OF_EEVEE or ("BLENDER_RENDER" in engines and name not in _WITHOUT_EFFECT):
            yield panel


def register():
    for panel in _panels():
        panel.COMPAT_ENGINES.add(_ENGINE)


def unregister():
    for panel in bpy.types.Panel.__subclasses__():
        if panel not in CLASSES:
            getattr(panel, "COMPAT_ENGINES", set()).discard(_ENGINE)
