"""What a render shows of a scene, as arrays for another Blender, which exports it: a scene that is being rendered must not get
new objects, and Blender's exporter sees a scene as viewports do. Modifiers are at the levels of renders; instances, poses and
curves are meshes."""

import json
import os

import bpy
import numpy as np
from mathutils import Matrix

_MESH_LIKE = {"MESH", "CURVE", "SURFACE", "FONT", "META"}
_LEFT_OUT = {
    "VOLUME": "a volume",
    "CURVES": "hair",
    "POINTCLOUD": "a point cloud",
    "GREASEPENCIL": "Grease Pencil",
    "GPENCIL": "Grease Pencil",
}
_VISIBILITY = {
    "visible_camera": "camera",
    "visible_diffuse": "diffuse",
    "visible_glossy": "glossy",
    "visible_transmission": "transmission",
    "visible_shadow": "shadow",
}
# Largest relative difference of a matrix from one of translation, rotation and scale.
_SHEAR = 1e-5


class Collected:
    def __init__(self, depsgraph, warnings):
        self._depsgraph = depsgraph
        self._warnings = warnings
        self._arrays = {}
        self._meshes = []
        self._mesh_of_key = {}
        self._materials = {}
        self._objects = []
        for instance in depsgraph.object_instances:
            self._add(instance)

    def is_empty(self):
        return not self._objects

    def write(self, folder):
        """Writes materials and arrays into a folder."""
        np.savez(os.path.join(folder, "arrays.npz"), **self._arrays)
        local = {material for material in self._materials.values() if not material.library}
        if local:
            bpy.data.libraries.write(os.path.join(folder, "materials.blend"), local, path_remap="ABSOLUTE", fake_user=True)
        materials = [
            {
                "name": material.name,
                # A linked one is in its own file.
                "library": bpy.path.abspath(material.library.filepath) if material.library else None,
            }
            for material in self._materials.values()
        ]
        scene = self._depsgraph.scene
        description = {
            "frame": [scene.frame_current, scene.frame_subframe],
            "materials": materials,
            "meshes": self._meshes,
            "objects": self._objects,
        }
        with open(os.path.join(folder, "description.json"), "w", encoding="utf-8") as file:
            json.dump(description, file)

    def _add(self, instance):
        original = instance.object.original
        if instance.object.type in _LEFT_OUT:
            self._warnings.append(f"{original.name} is left out: it is {_LEFT_OUT[instance.object.type]}")
        if instance.object.type not in _MESH_LIKE or not instance.show_self:
            return
        matrix = instance.matrix_world.copy()
        unsheared = Matrix.LocRotScale(*matrix.decompose())
        difference = max(abs(a - b) for mine, its in zip(matrix, unsheared) for a, b in zip(mine, its))
        if difference <= _SHEAR * max(abs(value) for row in matrix.to_3x3() for value in row):
            mesh = self._mesh_of(instance.object)
        else:
            # A node of the exporter has no shear.
            mesh = self._new_mesh(instance.object, matrix)
            matrix = Matrix()
        if mesh is None:
            return
        self._warn_of_visibility(original)
        self._objects.append({"name": original.name, "mesh": mesh, "matrix": [list(row) for row in matrix]})

    def _mesh_of(self, evaluated):
        """The index of an object's mesh; None if it has no faces. Instances share it."""
        slots = tuple(slot.material.name_full if slot.material else None for slot in evaluated.material_slots)
        key = evaluated.data.as_pointer(), slots
        if key not in self._mesh_of_key:
            self._mesh_of_key[key] = self._new_mesh(evaluated, None)
        return self._mesh_of_key[key]

    def _new_mesh(self, evaluated, matrix):
        mesh = evaluated.to_mesh(preserve_all_data_layers=True, depsgraph=self._depsgraph)
        try:
            if mesh is None or not mesh.polygons:
                return None
            if matrix:
                mesh.transform(matrix)
                if matrix.to_3x3().determinant() < 0:
                    mesh.flip_normals()
            return self._add_mesh(evaluated, mesh)
        finally:
            evaluated.to_mesh_clear()

    def _add_mesh(self, evaluated, mesh):
        index = len(self._meshes)
        mesh.calc_loop_triangles()

        def read(of, name, width, kind=np.float32):
            values = np.empty(len(of) * width, kind)
            of.foreach_get(name, values)
            return values.reshape(-1, width) if width > 1 else values

        corners = read(mesh.loop_triangles, "loops", 3, np.int32).reshape(-1)
        vertices = read(mesh.loops, "vertex_index", 1, np.int32)
        self._arrays[f"{index} places"] = read(mesh.vertices, "co", 3)
        self._arrays[f"{index} vertices"] = vertices[corners]
        self._arrays[f"{index} normals"] = read(mesh.corner_normals, "vector", 3)[corners]
        used = read(mesh.loop_triangles, "material_index", 1, np.int32)
        materials = [slot.material for slot in evaluated.material_slots] or [None]
        used = np.clip(used, 0, len(materials) - 1)
        self._arrays[f"{index} materials"] = used
        shown = set(used.tolist())
        layers, colors = [], []
        for layer in mesh.uv_layers:
            self._arrays[f"{index} layer {len(layers)}"] = read(layer.uv, "vector", 2)[corners]
            layers.append({"name": layer.name, "is_active": layer.active_render})
        for color in mesh.color_attributes:
            values = read(color.data, "color", 4)
            self._arrays[f"{index} color {len(colors)}"] = values[vertices[corners] if color.domain == "POINT" else corners]
            colors.append({"name": color.name, "is_active": mesh.color_attributes.render_color_index == len(colors)})
        self._meshes.append(
            {
                "name": evaluated.original.data.name if evaluated.original.data else evaluated.name,
                "materials": [self._material(material) if i in shown else None for i, material in enumerate(materials)],
                "layers": layers,
                "colors": colors,
            }
        )
        return index

    def _material(self, material):
        """Its index; None for none."""
        if material is None:
            return None
        original = material.original
        self._materials.setdefault(original.name_full, original)
        return list(self._materials).index(original.name_full)

    def _warn_of_visibility(self, original):
        hidden = [name for flag, name in _VISIBILITY.items() if not getattr(original, flag, True)]
        if hidden:
            self._warnings.append(f"{original.name} is shown to all rays (in Blender hidden from {', '.join(hidden)})")
        for flag, name in (("is_holdout", "a holdout"), ("is_shadow_catcher", "a shadow catcher")):
            if getattr(original, flag, False):
                self._warnings.append(f"{original.name} is shown as it is (in Blender {name})")
