"""The camera: projection, shift and lens."""

import math

import numpy as np
from mathutils import Matrix

from ..film import whole_size
from ..program import ProgramError


class Camera:
    def __init__(self, depsgraph, warnings):
        scene = depsgraph.scene
        if scene.camera is None:
            raise ProgramError("The scene has no camera")
        self._object = scene.camera.evaluated_get(depsgraph)
        self._data = self._object.data
        if self._data.type == "PANO":
            raise ProgramError("The camera is panoramic, which ppm-vk has not: make it perspective or orthographic")
        render = scene.render
        if render.use_multiview:
            raise ProgramError("ppm-vk renders one view: turn Stereoscopy off")
        if render.pixel_aspect_x != render.pixel_aspect_y:
            warnings.append("Pixels are square in ppm-vk: the pixel aspect is left out")
        self._size = whole_size(render)
        self._projection = self._object.calc_matrix_camera(depsgraph, x=self._size[0], y=self._size[1])
        # Without its scale.
        place, rotation, _ = self._object.matrix_world.decompose()
        self._matrix = Matrix.LocRotScale(place, rotation, None)
        if self._data.dof.use_dof and (self._data.dof.aperture_blades or self._data.dof.aperture_ratio != 1):
            warnings.append("The lens is round in ppm-vk: aperture blades and ratio are left out")

    def add_to(self, document):
        width, height = self._size
        if self._data.type == "ORTHO":
            halves = {"xmag": 1 / self._projection[0][0], "ymag": 1 / self._projection[1][1]}
            camera = {"type": "orthographic", "orthographic": {**halves, "znear": 0, "zfar": self._data.clip_end}}
        else:
            angle = 2 * math.atan(1 / self._projection[1][1])
            perspective = {"yfov": angle, "aspectRatio": width / height, "znear": self._data.clip_start}
            camera = {"type": "perspective", "perspective": perspective}
        camera["name"] = self._object.name
        document.json["cameras"] = [camera]
        document.add_node(self._object.name, self._matrix, camera=0)

    def _shift(self):
        """By how much of the picture's larger side the film is moved to the right and up."""
        column = 3 if self._data.type == "ORTHO" else 2
        sign = -1 if self._data.type == "ORTHO" else 1
        larger = max(self._size)
        return [sign * self._projection[axis][column] / 2 * self._size[axis] / larger for axis in (0, 1)]

    def arguments(self):
        arguments = []
        shift = self._shift()
        if any(abs(part) > 1e-7 for part in shift):
            arguments.append(f"--shift={shift[0]:.9g},{shift[1]:.9g}")
        dof = self._data.dof
        if dof.use_dof:
            # As in Cycles, whose lens has no focal length where the camera is orthographic.
            focal_length = 1 if self._data.type == "ORTHO" else 1e-3 * self._data.lens
            arguments.append(f"--aperture={focal_length / (2 * dof.aperture_fstop):.9g}")
            arguments.append(f"--focus={self._focus():.9g}")
        return arguments

    def _focus(self):
        target = self._data.dof.focus_object
        if target is None:
            return self._data.dof.focus_distance
        place = target.matrix_world.translation
        if self._data.dof.focus_subtarget and target.pose and self._data.dof.focus_subtarget in target.pose.bones:
            bone = target.pose.bones[self._data.dof.focus_subtarget]
            place = target.matrix_world @ bone.matrix.translation
        return abs((self._matrix.inverted() @ place).z)

    def directions(self, film):
        """Directions through the middles of a film's pixels, lines from the top, in Blender's axes."""
        x = (film.left + np.arange(film.width) + 0.5) / self._size[0] * 2 - 1
        y = 1 - (film.top + np.arange(film.height) + 0.5) / self._size[1] * 2
        x, y = np.meshgrid(x, y)
        if self._data.type == "ORTHO":
            local = np.stack([0 * x, 0 * y, -np.ones_like(x)], axis=-1)
        else:
            m = self._projection
            local = np.stack([(x + m[0][2]) / m[0][0], (y + m[1][2]) / m[1][1], -np.ones_like(x)], axis=-1)
        local /= np.linalg.norm(local, axis=-1, keepdims=True)
        return local @ np.array(self._matrix.to_3x3()).T
