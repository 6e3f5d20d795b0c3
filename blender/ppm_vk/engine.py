"""The render engine: exports the scene, runs the program, and shows what it writes."""

import functools
import os
import tempfile
import threading
import time
import traceback

import bpy
import numpy as np

from . import export, exr, main_thread, program
from .film import Film
from .main_thread import Cancelled
from .program import ProgramError

# Seconds between looks at whether the user cancels.
_POLL = 0.05
# Seconds that a stopped program has for its picture before it is killed.
_PATIENCE = 30

_PHASES = {
    "load": "Loading the scene",
    "build": "Building the hierarchy",
    "compile": "Compiling kernels",
    "pilot": "Finding where photons are needed",
    "iterate": "Rendering",
    "write": "Writing the picture",
}


class PpmVkRenderEngine(bpy.types.RenderEngine):
    bl_idname = "PPM_VK"
    bl_label = "ppm-vk"
    # Materials are those of Cycles and EEVEE; EEVEE shows them in viewports.
    bl_use_shading_nodes_custom = False
    bl_use_eevee_viewport = True

    def render(self, depsgraph):
        try:
            with tempfile.TemporaryDirectory(prefix="ppm-vk-") as folder:
                self._render(depsgraph, folder)
        except ProgramError as error:
            self._fail(depsgraph, str(error))
        except Cancelled:
            self._show_nothing(depsgraph)
        except Exception as error:
            traceback.print_exc()
            self._fail(depsgraph, f"The add-on failed: {error!r}")

    def _fail(self, depsgraph, text):
        self._show_nothing(depsgraph)
        self.report({"ERROR"}, text)

    def _show_nothing(self, depsgraph):
        """Blender 4.2 crashes where it saves a picture that is not there."""
        width, height = Film.of_region(depsgraph.scene.render)[2:]
        self.end_result(self.begin_result(0, 0, width, height, layer=depsgraph.view_layer.name))

    def update_render_passes(self, scene, renderlayer):
        self.register_pass(scene, renderlayer, "Combined", 4, "RGBA", "COLOR")
        self.register_pass(scene, renderlayer, "Error", 3, "RGB", "COLOR")

    def _render(self, depsgraph, folder):
        path = program.find()
        scene = depsgraph.scene
        self.update_stats("", "Exporting the scene")
        warnings = self._on_main_thread(lambda: export.collect(depsgraph, folder))
        of_exporter = export.run_exporter(folder, self._is_cancelled)
        if of_exporter is None:
            raise Cancelled
        exported = self._on_main_thread(lambda: export.complete(depsgraph, folder))
        for text in dict.fromkeys(warnings + of_exporter + exported.warnings):
            self.report({"WARNING"}, text)
        film = Film(scene, exported.camera, exported.background, program.has_flag(path, "--crop"))
        output = os.path.join(folder, "picture.exr")
        arguments = [f"--scene={exported.scene}", f"--output={output}", *film.arguments(), *exported.arguments]
        arguments += scene.ppm_vk.to_arguments()
        run = program.Run(path, arguments, folder)
        try:
            self._follow(run, depsgraph.view_layer.name, film, output)
        finally:
            run.kill()

    def _is_cancelled(self):
        return self.test_break()

    def _on_main_thread(self, work):
        """Runs what reads the user's data-blocks while the user can't change them: with a window a render has a thread of its own."""
        if bpy.app.background or threading.current_thread() is threading.main_thread():
            return work()
        schedule = functools.partial(bpy.app.timers.register, first_interval=0)
        return main_thread.run(work, schedule, self._is_cancelled)

    def _follow(self, run, layer, film, output):
        stopped_at = None
        failure = None
        phase = ""
        written = False
        while True:
            event = run.next_event(_POLL)
            if stopped_at is None and self._is_cancelled():
                run.stop()
                stopped_at = time.monotonic()
                self.update_stats("", "Stopping")
            if stopped_at and time.monotonic() > stopped_at + _PATIENCE:
                run.kill()
            if event is None:
                continue
            kind = event["event"]
            if kind == "phase":
                phase = _PHASES.get(event["phase"], event["phase"])
                self.update_stats("", phase)
            elif kind == "iteration":
                self.update_progress(event["share"] or 0)
                self.update_stats("", _statistics(phase, event))
            elif kind == "warning":
                self.report({"WARNING"}, event["text"])
            elif kind == "error":
                failure = event["text"]
            elif kind == "written" and os.path.abspath(event["path"]) == os.path.abspath(output):
                self._show(layer, film, output)
                written = True
            elif kind == "end":
                break
        code = run.wait()
        if stopped_at is None and code != 0:
            raise ProgramError(f"ppm-vk failed: {failure or run.last_line()}")
        if not written and stopped_at is None:
            raise ProgramError("ppm-vk ended without a picture")

    def _show(self, layer, film, path):
        """Shows a picture that the program has written."""
        passes = film.passes(exr.read(path))
        for name, pixels in passes.items():
            if name != "Combined":
                channels = pixels.shape[2]
                self.add_pass(name, channels, {1: "X", 3: "RGB", 4: "RGBA"}.get(channels, "RGBA"[:channels]), layer=layer)
        result = self.begin_result(0, 0, film.width, film.height, layer=layer)
        for of_layer in result.layers[0].passes:
            pixels = passes.get(of_layer.name)
            if pixels is not None:
                of_layer.rect.foreach_set(np.ascontiguousarray(pixels[::-1], np.float32).ravel())
        self.end_result(result)


def _statistics(phase, event):
    parts = [phase, f"Iteration {event['iteration']}"]
    if event.get("iterations"):
        parts[-1] += f"/{event['iterations']}"
    if event.get("estimated_error") is not None:
        parts.append(f"Error {100 * event['estimated_error']:.2g} %")
    if event.get("photons_per_second"):
        parts.append(f"{event['photons_per_second'] / 1e6:.2f} M photons/s")
    if event.get("seconds_left") is not None:
        minutes, seconds = divmod(int(event["seconds_left"]), 60)
        parts.append(f"Remaining {minutes:02}:{seconds:02}")
    return " | ".join(parts)
