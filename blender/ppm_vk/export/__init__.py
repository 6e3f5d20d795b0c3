"""Exports an evaluated scene: by Blender's own glTF exporter, and in addition what that one drops."""

import os
from dataclasses import dataclass

import bpy

from ..program import ProgramError
from . import camera, lights, world
from .flatten import Flattened
from .gltf import Document


@dataclass
class Exported:
    scene: str  # the glTF file
    arguments: list
    camera: camera.Camera
    background: world.Background
    warnings: list


def export_scene(depsgraph, folder):
    """Writes the scene of a depsgraph, as it is at its frame, into a folder."""
    warnings = []
    of_camera = camera.Camera(depsgraph, warnings)
    path = os.path.join(folder, "scene.gltf")
    with Flattened(depsgraph, warnings) as flattened:
        if flattened.is_empty:
            raise ProgramError("There is nothing to render: the scene has no mesh that renders show")
        _run_exporter(flattened.scene, path)
        document = Document(path)
        flattened.restore_names(document)
        flattened.materials.complete(document)
    lights.add(document, depsgraph, warnings)
    of_camera.add_to(document)
    document.write()
    background = world.Background(depsgraph, warnings)
    arguments = ["--light-units=spec", "--solid-glass", *of_camera.arguments()]
    arguments += background.arguments(folder, is_dark=document.is_dark())
    if depsgraph.scene.render.use_motion_blur:
        warnings.append("Motion blur is left out")
    return Exported(path, arguments, of_camera, background, list(dict.fromkeys(warnings)))


def _run_exporter(scene, path):
    operator = bpy.ops.export_scene.gltf
    options = {
        "export_format": "GLTF_SEPARATE",
        "use_active_scene": True,
        "export_extras": True,
        "export_animations": False,
        "export_skins": False,
        "export_morph": False,
        "export_cameras": False,
        "export_lights": False,
        "export_current_frame": True,
        "export_rest_position_armature": False,
        "export_apply": True,
        "export_import_convert_lighting_mode": "COMPAT",
    }
    try:
        known = set(operator.get_rna_type().properties.keys())
    except (AttributeError, KeyError):
        raise ProgramError("Blender's glTF exporter is off: enable the add-on «glTF 2.0 format» in the preferences") from None
    options = {name: value for name, value in options.items() if name in known}
    try:
        with bpy.context.temp_override(scene=scene, view_layer=scene.view_layers[0]):
            operator(filepath=path, **options)
    except RuntimeError as error:
        reason = [line for line in str(error).splitlines() if line.strip() and not line.startswith("Location:")]
        raise ProgramError(f"Blender's glTF exporter failed: {reason[-1] if reason else 'it does not say why'}") from error
