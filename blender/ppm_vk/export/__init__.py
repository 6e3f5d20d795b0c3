"""Exports what a render shows of a scene: by Blender's own glTF exporter, and in addition what that one drops."""

import json
import os
import subprocess
import sys
from dataclasses import dataclass

import bpy

from ..program import ProgramError, start
from . import camera, lights, world
from .collect import Collected
from .gltf import Document


@dataclass
class Exported:
    scene: str  # the glTF file
    arguments: list
    camera: camera.Camera
    background: world.Background
    warnings: list


def collect(depsgraph, folder):
    """Writes for `run_exporter` what a render shows at the frame of a depsgraph."""
    warnings = []
    collected = Collected(depsgraph, warnings)
    if collected.is_empty():
        raise ProgramError("There is nothing to render: the scene has no mesh that renders show")
    collected.write(folder)
    return warnings


def run_exporter(folder, is_cancelled):
    """Exports what `collect` has written, by another Blender. Returns warnings."""
    script = os.path.join(os.path.dirname(os.path.abspath(__file__)), "child.py")
    if bpy.app.binary_path:
        command = [bpy.app.binary_path, "--background", "--factory-startup", "--python-exit-code", "1", "--python", script, "--", folder]
    else:
        # Blender as a module.
        command = [sys.executable, script, folder]
    process = start(command)
    lines = ""
    while True:
        try:
            lines = "\n".join(process.communicate(timeout=0.1))
            break
        except subprocess.TimeoutExpired:
            if is_cancelled():
                process.kill()
                process.communicate()
                return None
    if process.returncode != 0:
        print(lines)
        said = [line for line in lines.splitlines() if line.strip()]
        raise ProgramError(f"Blender's glTF exporter failed: {said[-1] if said else 'it does not say why'}")
    with open(os.path.join(folder, "warnings.json"), encoding="utf-8") as file:
        return json.load(file)


def complete(depsgraph, folder):
    """Adds to what the exporter wrote what it drops."""
    warnings = []
    of_camera = camera.Camera(depsgraph, warnings)
    path = os.path.join(folder, "scene.gltf")
    document = Document(path)
    lights.add(document, depsgraph, warnings)
    of_camera.add_to(document)
    document.write()
    background = world.Background(depsgraph, warnings)
    arguments = ["--light-units=spec", "--solid-glass", *of_camera.arguments()]
    arguments += background.arguments(folder, is_dark=document.is_dark())
    if depsgraph.scene.render.use_motion_blur:
        warnings.append("Motion blur is left out")
    return Exported(path, arguments, of_camera, background, warnings)
