"""Materials look as in Cycles: six boards in a white world, one for each way in which a node tree becomes a Principled node."""

import os
import tempfile
import unittest

import bpy
import numpy as np

import support


def nodes(name, build):
    """A material whose surface is what `build` returns of its tree."""
    made = bpy.data.materials.new(name)
    made.use_nodes = True
    tree = made.node_tree
    tree.nodes.clear()
    output = tree.nodes.new("ShaderNodeOutputMaterial")
    tree.links.new(build(tree).outputs[0], output.inputs["Surface"])
    return made


def shader(tree, kind, **inputs):
    node = tree.nodes.new(kind)
    for key, value in inputs.items():
        node.inputs[key].default_value = value
    return node


def joined(tree, kind, first, second, factor=None):
    node = tree.nodes.new(kind)
    sockets = [socket for socket in node.inputs if socket.type == "SHADER"]
    for of_shader, socket in zip((first, second), sockets):
        tree.links.new(of_shader.outputs[0], socket)
    if factor is not None:
        node.inputs[0].default_value = factor
    return node


def diffuse(tree, color=(0.8, 0.4, 0.2, 1)):
    return shader(tree, "ShaderNodeBsdfDiffuse", Color=color)


def mirror(tree):
    return shader(tree, "ShaderNodeBsdfGlossy", Color=(0.9, 0.6, 0.3, 1), Roughness=0.0)


def half_transparent(tree):
    return joined(tree, "ShaderNodeMixShader", shader(tree, "ShaderNodeBsdfTransparent"), diffuse(tree), 0.3)


def glowing(tree):
    emission = shader(tree, "ShaderNodeEmission", Color=(0.1, 0.5, 1, 1), Strength=0.7)
    return joined(tree, "ShaderNodeAddShader", diffuse(tree), emission)


def textured(tree):
    image = bpy.data.images.new("quarters", 64, 64)
    v, u = np.mgrid[0:64, 0:64]
    pixels = np.stack([u > 31, v > 31, (u > 31) & (v < 32), np.ones_like(u)], axis=-1) * np.array([0.8, 0.7, 0.6, 1])
    image.pixels.foreach_set(pixels.astype(np.float32).ravel())
    image.pack()
    result = diffuse(tree)
    texture = tree.nodes.new("ShaderNodeTexImage")
    texture.image = image
    tree.links.new(texture.outputs["Color"], result.inputs["Color"])
    return result


def painted(tree):
    result = diffuse(tree)
    color = tree.nodes.new("ShaderNodeVertexColor")
    color.layer_name = "painted"
    tree.links.new(color.outputs["Color"], result.inputs["Color"])
    return result


class Materials(unittest.TestCase):
    def test_boards_look_as_in_cycles(self):
        scene = support.start()
        scene.render.resolution_x, scene.render.resolution_y = 72, 48
        scene.ppm_vk.iterations = 64
        support.world((1, 1, 1))
        builds = (diffuse, mirror, half_transparent, glowing, textured, painted)
        for i, build in enumerate(builds):
            place = (i % 3 - 1, 0, 0.5 - i // 3)
            board = support.plane(build.__name__, 0.5, nodes(build.__name__, build), place=place)
            board.rotation_euler = (np.pi / 2, 0, 0)
            data = board.data
            layer = data.uv_layers.new(name="uv")
            layer.uv.foreach_set("vector", [0, 0, 1, 0, 1, 1, 0, 1])
            color = data.color_attributes.new("painted", "FLOAT_COLOR", "POINT")
            color.data.foreach_set("color", [0.9, 0.1, 0.1, 1, 0.1, 0.8, 0.1, 1, 0.1, 0.1, 0.7, 1, 0.5, 0.5, 0.5, 1])
        camera = support.camera((0, -4, 0), (0, 0, 0)).data
        camera.type, camera.ortho_scale = "ORTHO", 3
        of_program, of_cycles = (support.blocks(support.render(engine), (12, 8)) for engine in ("PPM_VK", "CYCLES"))
        for i, build in enumerate(builds):
            box = np.s_[i // 3 * 4 : i // 3 * 4 + 4, i % 3 * 4 : i % 3 * 4 + 4]
            worst = np.abs(of_program[box] - of_cycles[box]).max() / of_cycles[box].max()
            print(f"{build.__name__}: worst block {100 * worst:.2f} %")
            with self.subTest(build.__name__):
                self.assertLess(worst, 0.02, f"by the program\n{of_program[box]}\nby Cycles\n{of_cycles[box]}")


    def test_materials_of_other_files_and_none_at_all(self):
        scene = support.start()
        scene.ppm_vk.iterations = 4
        with tempfile.TemporaryDirectory() as folder:
            path = os.path.join(folder, "library.blend")
            made = support.material("of a library", "ShaderNodeEmission", Color=(0.2, 0.7, 0.4, 1), Strength=2)
            bpy.data.libraries.write(path, {made}, fake_user=True)
            support.start()
            support.world((1, 1, 1))
            with bpy.data.libraries.load(path, link=True) as (there, here):
                here.materials = there.materials
            left = support.plane("left", 0.5, here.materials[0], place=(-0.5, 0, 0), target=(-0.5, -5, 0))
            right = support.plane("right", 0.5, None, place=(0.5, 0, 0), target=(0.5, -5, 0))
            right.data.materials.clear()
            self.assertTrue(left.data.materials[0].library)
            camera = support.camera((0, -4, 0), (0, 0, 0)).data
            camera.type, camera.ortho_scale = "ORTHO", 1.2
            picture = support.render("PPM_VK")
        np.testing.assert_allclose(picture[18, 10, :3], [0.4, 1.4, 0.8], rtol=1e-3)
        # Blender's default: a matte 0.8 below a coat.
        np.testing.assert_allclose(picture[18, 38, :3], [0.8] * 3, rtol=0.05)


if __name__ == "__main__":
    support.run()
