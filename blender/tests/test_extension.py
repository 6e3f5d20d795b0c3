"""The packed extension installs, and renders by the program that its preferences name. Argument: the zip file."""

import os
import shutil
import sys
import tempfile
import unittest
from importlib import import_module

# Blender's own folder of the user stays as it is.
_RESOURCES = tempfile.mkdtemp()
os.environ["BLENDER_USER_RESOURCES"] = _RESOURCES

import bpy

_NAME = "bl_ext.user_default.ppm_vk"


class Extension(unittest.TestCase):
    def test_it_installs_and_renders(self):
        bpy.ops.wm.read_factory_settings(use_empty=False)
        program = shutil.which("ppm-vk")
        bpy.ops.extensions.package_install_files(filepath=_ZIP, repo="user_default", enable_on_install=True)
        self.assertIn(_NAME, bpy.context.preferences.addons)
        scene = bpy.context.scene
        scene.render.engine = "PPM_VK"
        scene.render.resolution_x = scene.render.resolution_y = 32
        scene.ppm_vk.iterations = 2
        scene.render.filepath = os.path.join(_RESOURCES, "picture.png")
        preferences = import_module(_NAME + ".settings").preferences()
        preferences.program = os.path.join(_RESOURCES, "nothing")
        with self.assertRaisesRegex(RuntimeError, "There is no program"):
            bpy.ops.render.render()
        preferences.program = program
        bpy.ops.render.render(write_still=True)
        image = bpy.data.images.load(scene.render.filepath)
        self.assertGreater(max(list(image.pixels)[0::4]), 0.1, "the picture is black")
        bpy.ops.preferences.addon_disable(module=_NAME)
        self.assertFalse(hasattr(bpy.types.Scene, "ppm_vk"), "it leaves its settings when it is disabled")


if __name__ == "__main__":
    _ZIP = os.path.abspath(sys.argv.pop())
    program = unittest.main(verbosity=2, exit=False)
    shutil.rmtree(_RESOURCES)
    sys.stdout.flush()
    # Blender 4.2 as a module crashes on its way out.
    os._exit(not program.result.wasSuccessful())
