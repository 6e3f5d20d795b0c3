"""A scene for the exporter that has all that a render shows as meshes, evaluated as renders have it: modifiers at the levels of
renders, instances, poses. The exporter itself sees a scene as viewports do."""

import bpy
import numpy as np
from mathutils import Matrix

from .materials import Materials

# The custom property that tells what an exported object was made from.
MARK = "ppm_vk"

_MESH_LIKE = {"MESH", "CURVE", "SURFACE", "FONT", "META"}
_LEFT_OUT = {"VOLUME": "a volume", "CURVES": "hair", "POINTCLOUD": "a point cloud", "GREASEPENCIL": "Grease Pencil", "GPENCIL": "Grease Pencil"}
_VISIBILITY = {
    "visible_camera": "camera",
    "visible_diffuse": "diffuse",
    "visible_glossy": "glossy",
    "visible_transmission": "transmission",
    "visible_shadow": "shadow",
}
# Largest relative difference of a matrix from one of translation, rotation and scale.
_SHEAR = 1e-5


class Flattened:
    """A context: the data-blocks that it makes exist within."""

    def __init__(self, depsgraph, warnings):
        self._depsgraph = depsgraph
        self._warnings = warnings
        self._meshes = {}
        self._made = []
        self._names = []
        self.scene = None
        self.materials = Materials(depsgraph, warnings)
        self.is_empty = True

    def __enter__(self):
        try:
            self.scene = bpy.data.scenes.new("ppm-vk export")
            # Cycles' materials, not those of EEVEE.
            self.scene.render.engine = "CYCLES" if _has_engine("CYCLES") else self.scene.render.engine
            for instance in self._depsgraph.object_instances:
                self._add(instance)
        except BaseException:
            self.__exit__()
            raise
        return self

    def __exit__(self, *_error):
        made = self._made + self.materials.made
        if self.scene:
            bpy.data.scenes.remove(self.scene)
        bpy.data.batch_remove(made)

    def _add(self, instance):
        original = instance.object.original
        if instance.object.type in _LEFT_OUT:
            self._warnings.append(f"{original.name} is left out: it is {_LEFT_OUT[instance.object.type]}")
        if instance.object.type not in _MESH_LIKE or not instance.show_self:
            return
        mesh = self._mesh_of(instance.object)
        if mesh is None:
            return
        self._warn_of_visibility(original)
        matrix = instance.matrix_world.copy()
        unsheared = Matrix.LocRotScale(*matrix.decompose())
        difference = max(abs(a - b) for mine, its in zip(matrix, unsheared) for a, b in zip(mine, its))
        if difference > _SHEAR * max(abs(value) for row in matrix.to_3x3() for value in row):
            # A node of the exporter has no shear.
            mesh = self._keep(mesh.copy())
            mesh.transform(matrix)
            if matrix.to_3x3().determinant() < 0:
                mesh.flip_normals()
            matrix = Matrix()
        made = self._keep(bpy.data.objects.new(original.name, mesh))
        made[MARK] = len(self._names)
        self._names.append(original.name)
        made.matrix_world = matrix
        self.scene.collection.objects.link(made)
        self.is_empty = False

    def _keep(self, block):
        self._made.append(block)
        return block

    def _mesh_of(self, evaluated):
        """The mesh of an object, with copies of its materials; None if it has no faces. Instances share it."""
        slots = tuple(slot.material.name_full if slot.material else None for slot in evaluated.material_slots)
        key = evaluated.data.as_pointer(), slots
        if key not in self._meshes:
            mesh = bpy.data.meshes.new_from_object(evaluated, preserve_all_data_layers=True, depsgraph=self._depsgraph)
            self._meshes[key] = self._complete(self._keep(mesh)) if mesh.polygons else self._drop(mesh)
        return self._meshes[key]

    def _drop(self, mesh):
        bpy.data.meshes.remove(mesh)

    def _complete(self, mesh):
        if not mesh.materials:
            mesh.materials.append(None)
        used = np.empty(len(mesh.polygons), np.int32)
        mesh.polygons.foreach_get("material_index", used)
        closed = None
        for index in np.unique(np.clip(used, 0, len(mesh.materials) - 1)):
            copy = self.materials.copy_of(mesh.materials[index])
            mesh.materials[index] = copy
            if self.materials.absorbs(copy):
                closed = _is_closed(mesh) if closed is None else closed
                self.materials.note_mesh(copy, closed)
        return mesh

    def _warn_of_visibility(self, original):
        hidden = [name for flag, name in _VISIBILITY.items() if not getattr(original, flag, True)]
        if hidden:
            self._warnings.append(f"{original.name} is shown to all rays (in Blender hidden from {', '.join(hidden)})")
        for flag, name in (("is_holdout", "a holdout"), ("is_shadow_catcher", "a shadow catcher")):
            if getattr(original, flag, False):
                self._warnings.append(f"{original.name} is shown as it is (in Blender {name})")

    def restore_names(self, document):
        """Gives nodes and meshes the names of the objects that they were made from."""
        for node in document.json.get("nodes", ()):
            mark = document.take_mark(node, MARK)
            if mark is not None:
                node["name"] = self._names[mark]


def _is_closed(mesh):
    """Whether each edge lies between two faces; corners in the same place count as one."""
    places = np.empty(3 * len(mesh.vertices), np.float32)
    mesh.vertices.foreach_get("co", places)
    _, merged = np.unique(places.reshape(-1, 3), axis=0, return_inverse=True)
    edges = np.empty(2 * len(mesh.edges), np.int32)
    mesh.edges.foreach_get("vertices", edges)
    of_loops = np.empty(len(mesh.loops), np.int32)
    mesh.loops.foreach_get("edge_index", of_loops)
    ends = np.sort(merged.reshape(-1)[edges].reshape(-1, 2), axis=1)[of_loops]
    _, counts = np.unique(ends, axis=0, return_counts=True)
    return bool((counts == 2).all())


def _has_engine(name):
    return any(name == engine.bl_idname for engine in bpy.types.RenderEngine.__subclasses__() if hasattr(engine, "bl_idname"))
