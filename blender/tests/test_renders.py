"""Renders by the engine: stills, animations, regions, cancelling, errors; and what cameras and glass look like beside Cycles."""

import math
import os
import stat
import tempfile
import time
import unittest
from unittest import mock

import bpy
import numpy as np

import support
from ppm_vk.engine import PpmVkRenderEngine


def glowing(name, color, strength=1.0):
    return support.material(name, "ShaderNodeEmission", Color=(*color, 1), Strength=strength)


def boards():
    """Glowing boards at several distances, without symmetry."""
    support.world()
    support.plane("red", 0.5, glowing("red", (1, 0.1, 0.1)), place=(-0.7, 0, 0.2), target=(-0.7, -5, 0.2))
    support.plane("green", 0.3, glowing("green", (0.1, 1, 0.1)), place=(0.5, 1, 0.5), target=(0.5, -5, 0.5))
    support.plane("blue", 0.4, glowing("blue", (0.1, 0.1, 1)), place=(0.4, -1, -0.4), target=(0.4, -5, -0.4))
    return support.camera((0.2, -4, 0.1), (0, 0, 0), lens=40)


class Stills(unittest.TestCase):
    def setUp(self):
        self.scene = support.start()
        self.scene.ppm_vk.iterations = 4

    def kinds(self):
        return {name: len(getattr(bpy.data, name)) for name in ("scenes", "objects", "meshes", "materials", "images", "worlds")}

    def test_f12_renders_and_leaves_no_data_blocks(self):
        boards()
        before = self.kinds()
        picture = support.render("PPM_VK")
        after = self.kinds()
        after["images"] -= after["images"] - before["images"]  # the render result
        self.assertEqual(picture.shape, (36, 48, 4))
        self.assertTrue((picture[..., 3] == 1).all(), "a film that is not transparent has holes")
        self.assertGreater(picture[..., 0].max(), 0.9)
        self.assertEqual(before, after)

    def test_the_error_is_a_pass(self):
        support.floor()
        lamp = bpy.data.lights.new("lamp", "AREA")
        lamp.energy = 100
        support.link("lamp", lamp, (0, 0, 2), (0, 0, 0))
        shown = []
        show = PpmVkRenderEngine._show

        def note(engine, layer, film, path):
            from ppm_vk import exr

            shown.append(film.passes(exr.read(path)))
            show(engine, layer, film, path)

        if bpy.app.version >= (5, 0, 0):
            self.scene.render.image_settings.media_type = "MULTI_LAYER_IMAGE"
        self.scene.render.image_settings.file_format = "OPEN_EXR_MULTILAYER"
        self.scene.render.engine = "PPM_VK"
        with tempfile.TemporaryDirectory() as folder, mock.patch.object(PpmVkRenderEngine, "_show", note):
            self.scene.render.filepath = os.path.join(folder, "layers.exr")
            bpy.ops.render.render(write_still=True)
            with open(self.scene.render.filepath, "rb") as file:
                written = file.read()
        self.assertEqual(shown[-1]["Error"].shape, (36, 48, 3))
        self.assertGreater(shown[-1]["Error"].max(), 0)
        self.assertIn(b"Error.R", written, "the pass is not in a multilayer file")

    def test_partial_pictures_are_shown(self):
        boards()
        self.scene.ppm_vk.iterations = 0
        self.scene.ppm_vk.time = 4
        self.scene.ppm_vk.save_every = 0.5
        with mock.patch.object(PpmVkRenderEngine, "_show", autospec=True, side_effect=PpmVkRenderEngine._show) as show:
            support.render("PPM_VK")
        self.assertGreater(show.call_count, 2)

    def test_instances_and_modifiers_are_those_of_renders(self):
        support.world()
        board = support.mesh("board", [(-0.2, 0, -0.2), (0.2, 0, -0.2), (0.2, 0, 0.2), (-0.2, 0, 0.2)], [(0, 1, 2, 3)], glowing("white", (1, 1, 1)))
        hidden = support.link("of viewports alone", board, (0, 0, 1.2))
        hidden.hide_render = True
        arrayed = support.link("board", board, (-0.9, 0, -0.8))
        arrayed.hide_viewport = False
        modifier = arrayed.modifiers.new("array", "ARRAY")
        modifier.count = 3
        modifier.show_viewport = False
        collection = bpy.data.collections.new("boards")
        collection.objects.link(bpy.data.objects.new("inner", board))
        for x in (-0.8, 0.6):
            empty = support.link("instance", None, (x, 0, 0.5))
            empty.instance_type = "COLLECTION"
            empty.instance_collection = collection
        support.camera((0, -5, 0), (0, 0, 0))
        self.compare(0.02)

    def test_film_transparency_is_that_of_cycles(self):
        boards()
        support.world((0.3, 0.6, 0.9))
        self.scene.render.film_transparent = True
        self.compare(0.02, of_alpha=True)

    def test_film_transparency_leaves_out_a_worlds_picture(self):
        boards()
        support.world_of(support.sky(), 0.5, 1)
        self.scene.render.film_transparent = True
        self.compare(0.02, of_alpha=True)

    def test_a_shifted_camera_sees_what_cycles_does(self):
        for fit in ("AUTO", "VERTICAL"):
            self.setUp()
            camera = boards().data
            camera.shift_x, camera.shift_y, camera.sensor_fit = 0.13, -0.08, fit
            self.compare(0.02)

    def test_an_orthographic_camera_sees_what_cycles_does(self):
        camera = boards().data
        camera.type, camera.ortho_scale, camera.shift_x = "ORTHO", 2.6, 0.1
        self.compare(0.02)

    def test_a_lens_blurs_as_in_cycles(self):
        camera = boards().data
        camera.dof.use_dof = True
        camera.dof.aperture_fstop = 0.05
        camera.dof.focus_object = bpy.data.objects["red"]
        self.scene.ppm_vk.iterations = 256
        self.compare(0.02)

    def test_a_region_is_a_part_of_the_whole(self):
        boards()
        render = self.scene.render
        render.border_min_x, render.border_max_x, render.border_min_y, render.border_max_y = 0.22, 0.81, 0.13, 0.64
        whole = support.render("PPM_VK")
        render.use_border = True
        for crops in (False, True):
            render.use_crop_to_border = crops
            part = support.render("PPM_VK")
            box = np.s_[36 - int(0.64 * 36) : 36 - int(0.13 * 36), int(0.22 * 48) : int(0.81 * 48)]
            self.assertEqual(part.shape, whole[box].shape if crops else whole.shape)
            np.testing.assert_array_equal(part if crops else part[box], whole[box])

    def test_glass_absorbs_as_in_cycles(self):
        support.world()
        support.plane("board", 3, glowing("white", (1, 1, 1)), place=(0, 1, 0), target=(0, -5, 0))
        glass = support.material("glass", "ShaderNodeBsdfGlass", Roughness=0, IOR=1.3)
        volume = glass.node_tree.nodes.new("ShaderNodeVolumeAbsorption")
        volume.inputs["Color"].default_value = (0.9, 0.5, 0.2, 1)
        volume.inputs["Density"].default_value = 1.5
        glass.node_tree.links.new(volume.outputs[0], glass.node_tree.nodes["Material Output"].inputs["Volume"])
        bpy.ops.mesh.primitive_cube_add(size=1, location=(0, 0, 0))
        cube = bpy.context.object
        cube.scale = (1, 0.6, 1)
        cube.data.materials.append(glass)
        support.camera((0, -4, 0), (0, 0, 0), lens=70)
        self.scene.ppm_vk.iterations = 128
        self.compare(0.02)

    def test_principled_glass_tints_as_in_cycles(self):
        support.world()
        support.plane("board", 3, glowing("white", (1, 1, 1)), place=(0, 1, 0), target=(0, -5, 0))
        values = {"Base_Color": (0.9, 0.5, 0.2, 1), "Transmission_Weight": 1, "Roughness": 0, "IOR": 1.3}
        bpy.ops.mesh.primitive_cube_add(size=1, location=(0, 0, 0))
        bpy.context.object.data.materials.append(support.material("glass", "ShaderNodeBsdfPrincipled", **values))
        support.camera((0, -4, 0), (0, 0, 0), lens=70)
        self.scene.ppm_vk.iterations = 128
        self.compare(0.02)

    def compare(self, tolerance, of_alpha=False):
        """Blocks of 12×12 pixels differ by no more than this part of the brightest, beyond the noise."""
        pictures = [support.render(engine, samples=1024) for engine in ("PPM_VK", "CYCLES")]
        of_program, of_cycles = (support.blocks(picture) for picture in pictures)
        worst = np.abs(of_program - of_cycles).max() / of_cycles.max()
        print(f"{self.id().split('.')[-1]}: worst block {100 * worst:.2f} %")
        self.assertLess(worst, tolerance, f"by the program\n{of_program}\nby Cycles\n{of_cycles}")
        if of_alpha:
            alphas = [support.blocks(np.repeat(picture[..., 3:], 3, axis=2)) for picture in pictures]
            self.assertLess(np.abs(alphas[0] - alphas[1]).max(), tolerance)


class Animations(unittest.TestCase):
    def test_each_frame_is_rendered_at_its_time(self):
        scene = support.start()
        scene.ppm_vk.iterations = 2
        support.camera((0, -4, 0), (0, 0, 0))
        support.world()
        white = glowing("white", (1, 1, 1))
        board = support.plane("board", 0.3, white, place=(-1, 0, 0), target=(-1, -5, 0))
        board.keyframe_insert("location", frame=1)
        board.location.x = 1
        board.keyframe_insert("location", frame=3)
        strength = white.node_tree.nodes["Emission"].inputs["Strength"]
        strength.default_value = 1
        strength.keyframe_insert("default_value", frame=1)
        strength.default_value = 3
        strength.keyframe_insert("default_value", frame=3)
        scene.frame_start, scene.frame_end = 1, 3
        scene.render.engine = "PPM_VK"
        with tempfile.TemporaryDirectory() as folder:
            scene.render.filepath = os.path.join(folder, "frame.")
            bpy.ops.render.render(animation=True)
            self.assertEqual(sorted(os.listdir(folder)), [f"frame.{frame:04}.exr" for frame in (1, 2, 3)])
            pictures = [support.load(os.path.join(folder, f"frame.{frame:04}.exr")) for frame in (1, 2, 3)]
        for frame, picture in enumerate(pictures):
            red = picture[..., 0]
            self.assertAlmostEqual(red.max(), 1 + frame, places=3, msg=f"strength of frame {frame + 1}")
            middle = (red * np.arange(48)).sum() / red.sum()
            # The board is 1 to the side at a distance of 4; the picture's half is 36/2/50 of the distance.
            self.assertAlmostEqual(middle, 23.5 + (frame - 1) * 24 / (4 * 0.36), delta=0.5)


class Cancelling(unittest.TestCase):
    def test_a_cancelled_render_ends_the_program_and_shows_what_there_is(self):
        scene = support.start()
        boards()
        scene.ppm_vk.iterations = 1000000
        scene.ppm_vk.save_every = 1
        shown, runs = [], []
        from ppm_vk import program

        show, start = PpmVkRenderEngine._show, program.Run.__init__

        def note_show(engine, *arguments):
            shown.append(time.monotonic())
            show(engine, *arguments)

        def note_run(run, *arguments):
            runs.append(run)
            start(run, *arguments)

        with (
            mock.patch.object(PpmVkRenderEngine, "_show", note_show),
            mock.patch.object(program.Run, "__init__", note_run),
            mock.patch.object(PpmVkRenderEngine, "_is_cancelled", lambda _engine: len(shown) >= 2),
        ):
            begin = time.monotonic()
            picture = support.render("PPM_VK")
        self.assertIsNotNone(runs[0]._process.poll(), "the program still runs")
        self.assertEqual(runs[0]._process.returncode, 130, "it was not stopped in the orderly way")
        self.assertLess(time.monotonic() - shown[1], 15, "cancelling took long")
        self.assertGreaterEqual(len(shown), 3, "the last picture is not shown")
        self.assertGreater(picture[..., 0].max(), 0.9)


class Errors(unittest.TestCase):
    def setUp(self):
        self.scene = support.start()
        boards()

    def assert_fails(self, text):
        with self.assertRaisesRegex(RuntimeError, text):
            support.render("PPM_VK")

    def test_a_missing_program_is_told(self):
        with mock.patch.dict(os.environ, {"PATH": ""}):
            self.assert_fails("ppm-vk is not on the search path")

    def test_a_program_that_fails_is_told_with_its_line(self):
        self.scene.ppm_vk.device = "no such device"
        self.assert_fails("no such device")

    def test_wrong_arguments_are_told(self):
        self.scene.ppm_vk.arguments = "--no-such-flag"
        self.assert_fails("no-such-flag")

    def test_a_program_that_says_nothing_is_told(self):
        with tempfile.TemporaryDirectory() as folder:
            path = os.path.join(folder, "ppm-vk")
            with open(path, "w") as file:
                file.write("#!/bin/sh\nexit 1\n")
            os.chmod(path, stat.S_IRWXU)
            with mock.patch.dict(os.environ, {"PATH": f"{folder}:{os.environ['PATH']}"}):
                self.assert_fails("ppm-vk failed")

    def test_a_scene_without_meshes_is_told(self):
        for thing in list(bpy.data.objects):
            if thing.type == "MESH":
                bpy.data.objects.remove(thing)
        self.assert_fails("nothing to render")

    def test_a_scene_without_a_camera_is_told(self):
        self.scene.camera = None
        self.assert_fails("[Cc]amera")


if __name__ == "__main__":
    support.run()
