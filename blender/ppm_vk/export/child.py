"""Runs in a Blender of its own: makes a scene of what `collect` has written, and exports it by Blender's glTF exporter.

Arguments: the folder. It writes scene.gltf and warnings.json."""

import json
import os
import sys

import bpy
import numpy as np
from mathutils import Matrix

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from gltf import Document
from materials import Materials

MARK = "ppm_vk"


def main(folder):
    with open(os.path.join(folder, "description.json"), encoding="utf-8") as file:
        description = json.load(file)
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    scene = bpy.context.scene
    originals = load_materials(description["materials"], folder)
    arrays = np.load(os.path.join(folder, "arrays.npz"))
    meshes = [make_mesh(index, mesh, arrays, originals) for index, mesh in enumerate(description["meshes"])]
    for index, entry in enumerate(description["objects"]):
        made = bpy.data.objects.new(entry["name"], meshes[entry["mesh"]])
        made[MARK] = index
        made.matrix_world = Matrix(entry["matrix"])
        scene.collection.objects.link(made)
    # Materials may be animated.
    frame, subframe = description["frame"]
    scene.frame_set(frame, subframe=subframe)
    warnings = []
    materials = Materials(bpy.context.evaluated_depsgraph_get(), warnings)
    for index, mesh in enumerate(meshes):
        complete(mesh, arrays[f"{index} materials"], materials)
    path = os.path.join(folder, "scene.gltf")
    export(path)
    document = Document(path)
    for node in document.json.get("nodes", ()):
        mark = document.take_mark(node, MARK)
        if mark is not None:
            node["name"] = description["objects"][mark]["name"]
    materials.complete(document)
    document.write()
    with open(os.path.join(folder, "warnings.json"), "w", encoding="utf-8") as file:
        json.dump(warnings, file)


def load_materials(entries, folder):
    loaded = {}
    for library in {entry["library"] for entry in entries}:
        names = [entry["name"] for entry in entries if entry["library"] == library]
        path = library or os.path.join(folder, "materials.blend")
        with bpy.data.libraries.load(path) as (there, here):
            here.materials = [name for name in names if name in there.materials]
            found = list(here.materials)
        loaded.update({(library, name): material for name, material in zip(found, here.materials)})
    return [loaded.get((entry["library"], entry["name"])) for entry in entries]


def make_mesh(index, entry, arrays, originals):
    mesh = bpy.data.meshes.new(entry["name"])
    places, vertices = arrays[f"{index} places"], arrays[f"{index} vertices"]
    mesh.vertices.add(len(places))
    mesh.vertices.foreach_set("co", places.ravel())
    mesh.loops.add(len(vertices))
    mesh.loops.foreach_set("vertex_index", vertices)
    mesh.polygons.add(len(vertices) // 3)
    mesh.polygons.foreach_set("loop_start", np.arange(0, len(vertices), 3, dtype=np.int32))
    for material in entry["materials"]:
        mesh.materials.append(originals[material] if material is not None else None)
    mesh.polygons.foreach_set("material_index", arrays[f"{index} materials"])
    for i, layer in enumerate(entry["layers"]):
        made = mesh.uv_layers.new(name=layer["name"])
        made.uv.foreach_set("vector", arrays[f"{index} layer {i}"].ravel())
        made.active_render = layer["is_active"]
    for i, color in enumerate(entry["colors"]):
        made = mesh.color_attributes.new(color["name"], "FLOAT_COLOR", "CORNER")
        made.data.foreach_set("color", arrays[f"{index} color {i}"].ravel())
        if color["is_active"]:
            mesh.color_attributes.render_color_index = i
    mesh.update(calc_edges=True)
    mesh.normals_split_custom_set(arrays[f"{index} normals"])
    return mesh


def complete(mesh, used, materials):
    """Replaces a mesh's materials by copies for the exporter."""
    closed = None
    for index in np.unique(used):
        copy = materials.copy_of(mesh.materials[index])
        mesh.materials[index] = copy
        if materials.absorbs(copy):
            closed = is_closed(mesh) if closed is None else closed
            materials.note_mesh(copy, closed)


def is_closed(mesh):
    """Whether each edge lies between two triangles; corners in the same place count as one."""
    places = np.empty(3 * len(mesh.vertices), np.float32)
    mesh.vertices.foreach_get("co", places)
    _, merged = np.unique(places.reshape(-1, 3), axis=0, return_inverse=True)
    vertices = np.empty(len(mesh.loops), np.int32)
    mesh.loops.foreach_get("vertex_index", vertices)
    corners = merged.reshape(-1)[vertices].reshape(-1, 3)
    edges = np.sort(np.concatenate([corners[:, [0, 1]], corners[:, [1, 2]], corners[:, [2, 0]]]), axis=1)
    _, counts = np.unique(edges[edges[:, 0] != edges[:, 1]], axis=0, return_counts=True)
    return bool((counts % 2 == 0).all())


def export(path):
    operator = bpy.ops.export_scene.gltf
    options = {
        "export_format": "GLTF_SEPARATE",
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
    operator(filepath=path, **options)


if __name__ == "__main__":
    main(sys.argv[-1])
    # Blender's own way out takes time, and as a module may crash.
    sys.stdout.flush()
    os._exit(0)
