"""Scenes and renders for the tests of the add-on. Blender is the module bpy of PyPI; ppm-vk is on the search path."""

import math
import os
import sys
import tempfile
import unittest

import bpy
import numpy as np
from mathutils import Matrix, Vector

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), ".."))
import ppm_vk
from parts import mesh, world

SIZE = (48, 36)


def run():
    """Runs the tests of a file."""
    program = unittest.main("__main__", verbosity=2, exit=False)
    sys.stdout.flush()
    # Blender 4.2 as a module crashes on its way out.
    os._exit(not program.result.wasSuccessful())


def start():
    """Blender's factory settings, an empty scene, and the add-on."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    if not hasattr(bpy.types.Scene, "ppm_vk"):
        ppm_vk.register()
    scene = bpy.context.scene
    scene.render.resolution_x, scene.render.resolution_y = SIZE
    scene.render.resolution_percentage = 100
    scene.render.image_settings.file_format = "OPEN_EXR"
    scene.render.image_settings.color_depth = "32"
    scene.render.image_settings.color_mode = "RGBA"
    scene.ppm_vk.photons = 20000
    scene.ppm_vk.iterations = 32
    return scene


def render(engine, samples=256):
    """The picture of the scene: lines from the top, RGBA."""
    scene = bpy.context.scene
    scene.render.engine = engine
    if engine == "CYCLES":
        scene.cycles.samples = samples
        scene.cycles.use_adaptive_sampling = False
        scene.cycles.use_denoising = False
        scene.cycles.pixel_filter_type = "BOX"
        scene.cycles.filter_width = 1
        scene.cycles.use_light_tree = False
    with tempfile.TemporaryDirectory() as folder:
        scene.render.filepath = os.path.join(folder, "picture.exr")
        bpy.ops.render.render(write_still=True)
        return load(scene.render.filepath)


def load(path):
    image = bpy.data.images.load(path)
    try:
        width, height = image.size
        pixels = np.array(image.pixels[:], np.float32).reshape(height, width, -1)
        return pixels[::-1]
    finally:
        bpy.data.images.remove(image)


def link(name, data, place=(0, 0, 0), target=None, roll=0.0, scale=(1, 1, 1)):
    """An object; one with a target looks along −z to it."""
    made = bpy.data.objects.new(name, data)
    rotation = Matrix.Identity(4)
    if target is not None:
        towards = Vector(target) - Vector(place)
        rotation = towards.to_track_quat("-Z", "Y").to_matrix().to_4x4() @ Matrix.Rotation(roll, 4, "Z")
    made.matrix_world = Matrix.Translation(place) @ rotation @ Matrix.Diagonal((*scale, 1))
    bpy.context.scene.collection.objects.link(made)
    return made


def camera(place, target, lens=50):
    data = bpy.data.cameras.new("camera")
    data.lens = lens
    made = link("camera", data, place, target)
    bpy.context.scene.camera = made
    return made


def material(name, kind="ShaderNodeBsdfDiffuse", **inputs):
    made = bpy.data.materials.new(name)
    made.use_nodes = True
    tree = made.node_tree
    tree.nodes.clear()
    node = tree.nodes.new(kind)
    for key, value in inputs.items():
        node.inputs[key.replace("_", " ")].default_value = value
    output = tree.nodes.new("ShaderNodeOutputMaterial")
    tree.links.new(node.outputs[0], output.inputs["Surface"])
    return made


def grey(albedo=0.5):
    return material("grey", Color=(albedo, albedo, albedo, 1))


def plane(name, half, of_material, **where):
    return link(name, mesh(name, [(-half, -half, 0), (half, -half, 0), (half, half, 0), (-half, half, 0)], [(0, 1, 2, 3)], of_material), **where)


def floor():
    """A matte floor, seen from below the height of lamps."""
    plane("floor", 4, grey())
    camera((0, -2.4, 1.6), (0, 0, 0))


def blocks(picture, count=(4, 3)):
    """Means of RGB over parts of a picture."""
    height, width, _ = picture.shape
    return picture[..., :3].reshape(count[1], height // count[1], count[0], width // count[0], 3).mean(axis=(1, 3))


def world_of(image, strength, turn):
    """A world of a picture, turned about z."""
    made = world(strength=strength)
    tree = made.node_tree
    texture = tree.nodes.new("ShaderNodeTexEnvironment")
    texture.image = image
    mapping = tree.nodes.new("ShaderNodeMapping")
    mapping.inputs["Rotation"].default_value = (0, 0, turn)
    coordinates = tree.nodes.new("ShaderNodeTexCoord")
    tree.links.new(coordinates.outputs["Generated"], mapping.inputs["Vector"])
    tree.links.new(mapping.outputs["Vector"], texture.inputs["Vector"])
    tree.links.new(texture.outputs["Color"], tree.nodes["Background"].inputs["Color"])
    return made


def sky():
    """A smooth picture without symmetry."""
    width, height = 64, 32
    image = bpy.data.images.new("sky", width, height, float_buffer=True)
    u, v = np.meshgrid((np.arange(width) + 0.5) / width, (np.arange(height) + 0.5) / height)
    turn = 2 * math.pi * u
    pixels = np.stack([1.5 + np.sin(turn), 1.2 + np.cos(turn), 0.3 + 2 * v, np.ones_like(u)], axis=-1)
    image.pixels.foreach_set(pixels.astype(np.float32).ravel())
    image.pack()
    return image
