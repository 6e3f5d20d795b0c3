"""Parts of the add-on that need no render: threads, channels of pictures, EXR files."""

import os
import tempfile
import threading
import unittest

import bpy
import numpy as np

import support
from ppm_vk import exr, main_thread
from ppm_vk.engine import PpmVkRenderEngine
from ppm_vk.film import _split


class MainThread(unittest.TestCase):
    def run_in_thread(self, work, is_cancelled):
        """What a render's thread gets, and what is scheduled."""
        scheduled, got = [], []

        def render():
            try:
                got.append(main_thread.run(work, scheduled.append, is_cancelled))
            except BaseException as error:
                got.append(error)

        thread = threading.Thread(target=render)
        thread.start()
        while not scheduled:
            pass
        return thread, scheduled[0], got

    def test_the_result_comes_back(self):
        by = []
        thread, call, got = self.run_in_thread(lambda: by.append(threading.current_thread()) or 7, lambda: False)
        call()
        thread.join()
        self.assertEqual((got, by), ([7], [threading.current_thread()]))

    def test_what_is_raised_comes_back(self):
        thread, call, got = self.run_in_thread(lambda: 1 // 0, lambda: False)
        call()
        thread.join()
        self.assertIsInstance(got[0], ZeroDivisionError)

    def test_a_main_thread_that_waits_for_the_render_gets_no_deadlock(self):
        done = []
        thread, call, got = self.run_in_thread(lambda: done.append(1), lambda: True)
        thread.join(5)
        self.assertFalse(thread.is_alive(), "it waits for the main thread, which waits for it")
        self.assertIsInstance(got[0], main_thread.Cancelled)
        call()
        self.assertEqual(done, [], "work is done for a render that has ended")


class Pictures(unittest.TestCase):
    def test_channels_belong_to_passes(self):
        for name, expected in (
            ("R", ("Combined", "R")),
            ("A", ("Combined", "A")),
            ("error_G", ("Error", "G")),
            ("albedo.B", ("Albedo", "B")),
            ("ViewLayer.Combined.R", ("Combined", "R")),
            ("ViewLayer.Depth.Z", ("Depth", "Z")),
            ("CryptoObject00.r", ("CryptoObject00", "R")),
            ("samples", ("Samples", "X")),
        ):
            self.assertEqual(_split(name), expected, name)

    def test_exr_files_are_read_as_blender_writes_them(self):
        scene = support.start()
        random = np.random.default_rng(3).normal(size=(37, 29, 4)).astype(np.float32)
        image = bpy.data.images.new("noise", 29, 37, alpha=True, float_buffer=True)
        image.alpha_mode = "CHANNEL_PACKED"
        image.colorspace_settings.is_data = True
        image.pixels.foreach_set(random[::-1].ravel())
        settings = scene.render.image_settings
        settings.color_management = "OVERRIDE"
        for codec in ("NONE", "ZIP", "ZIPS"):
            for depth, tolerance in (("32", 0), ("16", 1e-3)):
                settings.exr_codec, settings.color_depth = codec, depth
                with tempfile.TemporaryDirectory() as folder:
                    path = os.path.join(folder, "noise.exr")
                    image.save_render(path, scene=scene)
                    picture = exr.read(path)
                self.assertEqual((picture.width, picture.height), (29, 37))
                for i, name in enumerate("RGBA"):
                    difference = np.abs(picture.channels[name] - random[..., i]) / (1 + np.abs(random[..., i]))
                    self.assertLessEqual(difference.max(), tolerance, f"{codec}, {depth} bits, {name}")

    def test_exr_files_are_written_as_blender_reads_them(self):
        pixels = np.random.default_rng(4).uniform(size=(7, 5, 3)).astype(np.float32)
        with tempfile.TemporaryDirectory() as folder:
            path = os.path.join(folder, "written.exr")
            exr.write(path, pixels)
            np.testing.assert_array_equal(support.load(path)[..., :3], pixels)
            again = exr.read(path)
        np.testing.assert_array_equal(np.stack([again.channels[name] for name in "RGB"], axis=-1), pixels)


class Panels(unittest.TestCase):
    def test_the_usual_panels_are_shown(self):
        support.start()
        for name in (
            "PPMVK_PT_sampling",
            "EEVEE_MATERIAL_PT_surface",
            "EEVEE_WORLD_PT_surface",
            "DATA_PT_EEVEE_light",
            "DATA_PT_camera_dof_aperture",
            "DATA_PT_lens",
            "RENDER_PT_format",
        ):
            self.assertIn(PpmVkRenderEngine.bl_idname, getattr(bpy.types, name).COMPAT_ENGINES, name)


if __name__ == "__main__":
    support.run()
