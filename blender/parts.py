"""Parts of scenes that scripts make, in Blender's module."""

import bpy


def mesh(name, corners, faces, of_material, smooth=False):
    made = bpy.data.meshes.new(name)
    made.from_pydata(corners, [], faces)
    made.materials.append(of_material)
    if smooth:
        made.polygons.foreach_set("use_smooth", [True] * len(made.polygons))
    made.update()
    return made


def world(color=(0, 0, 0), strength=1.0):
    made = bpy.data.worlds.new("world")
    made.use_nodes = True
    background = made.node_tree.nodes["Background"]
    background.inputs["Color"].default_value = (*color, 1)
    background.inputs["Strength"].default_value = strength
    bpy.context.scene.world = made
    return made
