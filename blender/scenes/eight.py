"""Eight scenes with caustics, made by script and rendered by ppm-vk and by Cycles for the same seconds, beside each other.

eight.py SHEET.png [--seconds S] [--size WxH] [--only NAME...] [--save FOLDER], with Blender's module bpy and ppm-vk on the search path.
Row by row two scenes, each by ppm-vk and, to its right, by Cycles. --save writes the scenes as .blend files."""

import argparse
import math
import os
import sys
import tempfile
import time

import bpy
import numpy as np
from mathutils import Matrix, Vector

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), ".."))
import ppm_vk
from parts import mesh, world

# ---- parts


def link(name, data, place=(0, 0, 0), target=None, turn=(0, 0, 0)):
    made = bpy.data.objects.new(name, data)
    made.location = place
    made.rotation_euler = turn
    if target is not None:
        made.rotation_euler = (Vector(target) - Vector(place)).to_track_quat("-Z", "Y").to_euler()
    bpy.context.scene.collection.objects.link(made)
    return made


def camera(place, target, lens=50, stop=None):
    data = bpy.data.cameras.new("camera")
    data.lens = lens
    if stop:
        data.dof.use_dof = True
        data.dof.aperture_fstop = stop
        data.dof.focus_distance = (Vector(target) - Vector(place)).length
    bpy.context.scene.camera = link("camera", data, place, target)


def lamp(kind, power, place, target=None, **values):
    data = bpy.data.lights.new("lamp", kind)
    data.energy = power
    for name, value in values.items():
        setattr(data, name, value)
    return link("lamp", data, place, target)


def material(name, absorption=None, **inputs):
    """Principled; absorption: colour and density of a Volume Absorption node."""
    made = bpy.data.materials.new(name)
    made.use_nodes = True
    node = made.node_tree.nodes["Principled BSDF"]
    for key, value in inputs.items():
        node.inputs[key.replace("_", " ")].default_value = value
    if absorption:
        volume = made.node_tree.nodes.new("ShaderNodeVolumeAbsorption")
        volume.inputs["Color"].default_value = (*absorption[0], 1)
        volume.inputs["Density"].default_value = absorption[1]
        made.node_tree.links.new(volume.outputs[0], made.node_tree.nodes["Material Output"].inputs["Volume"])
    return made


def matte(name, red, green, blue):
    return material(name, Base_Color=(red, green, blue, 1), Roughness=1, Specular_IOR_Level=0)


def glass(name, ior=1.5, absorption=None, **inputs):
    return material(name, absorption, Base_Color=(1, 1, 1, 1), Transmission_Weight=1, Roughness=0, IOR=ior, **inputs)


def glowing(name, color, strength):
    return material(name, Base_Color=(0, 0, 0, 1), Specular_IOR_Level=0, Emission_Color=(*color, 1), Emission_Strength=strength)


def lathe(name, outline, of_material, sides=96, smooth=True):
    """A closed outline of (radius, height), counter-clockwise, turned about z; the axis where the radius is 0."""
    corners, rings = [], []
    for radius, height in outline:
        if radius == 0:
            rings.append([len(corners)] * sides)
            corners.append((0, 0, height))
        else:
            rings.append(list(range(len(corners), len(corners) + sides)))
            turns = [2 * math.pi * i / sides for i in range(sides)]
            corners += [(radius * math.cos(turn), radius * math.sin(turn), height) for turn in turns]
    faces = []
    for low, high in zip(rings, rings[1:] + (rings[:1] if outline[0][0] else [])):
        for i in range(sides):
            j = (i + 1) % sides
            face = [low[i], low[j], high[j], high[i]]
            face = [corner for k, corner in enumerate(face) if corner != face[k - 1]]
            if len(face) > 2:
                faces.append(face)
    return mesh(name, corners, faces, of_material, smooth)


def box(name, low, high, of_material, inwards=False):
    corners = [[(low, high)[i >> axis & 1][axis] for axis in range(3)] for i in range(8)]
    faces = [(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)]
    return mesh(name, corners, [face[::-1] if inwards else face for face in faces], of_material)


def board(name, half, of_material):
    return mesh(name, [(-half, -half, 0), (half, -half, 0), (half, half, 0), (-half, half, 0)], [(0, 1, 2, 3)], of_material)


def sphere(name, radius, of_material, inner=None, rings=48):
    """Closed; with an inner radius a shell."""
    half = [(radius * math.sin(math.pi * i / rings), -radius * math.cos(math.pi * i / rings)) for i in range(rings + 1)]
    half[0], half[-1] = (0, -radius), (0, radius)
    made = lathe(name, half, of_material)
    if inner:
        inside = sphere(name, inner, of_material)
        inside.flip_normals()
        corners = [v.co[:] for v in made.vertices] + [v.co[:] for v in inside.vertices]
        count = len(made.vertices)
        faces = [list(p.vertices) for p in made.polygons] + [[count + i for i in p.vertices] for p in inside.polygons]
        made = mesh(name, corners, faces, of_material, True)
    return made


def torus(name, radius, thickness, of_material, sides=128, flat=1.0):
    turns = [2 * math.pi * i / 48 for i in range(48)]
    return lathe(name, [(radius + thickness * math.cos(t), flat * thickness * math.sin(t)) for t in turns], of_material, sides)


def tumbler(height=0.09, radius=0.04, wall=0.003, base=0.01):
    return [(0, 0), (radius, 0), (radius, height), (radius - wall, height), (radius - wall, base), (0, base)]


def liquid(level, radius=0.04, wall=0.003, base=0.01):
    """What is in a tumbler. It reaches into the walls, as nested dielectrics should."""
    reach = radius - wall / 2
    return [(0, base - wall / 2), (reach, base - wall / 2), (reach, level), (0, level)]


# ---- scenes


def glass_of_water():
    world((0.02, 0.02, 0.025))
    link("table", board("table", 1, matte("wood", 0.5, 0.4, 0.3)))
    link("glass", lathe("glass", tumbler(0.12), glass("glass"), smooth=False))
    link("water", lathe("water", liquid(0.085), glass("water", 1.33), smooth=False))
    lamp("AREA", 5, (-0.5, 0.35, 0.5), (0, 0, 0.05), size=0.08)
    camera((0.15, -0.45, 0.28), (0.02, 0, 0.045), 60)


def pool():
    world((0.25, 0.35, 0.5))
    width, height = 64, 64
    tiles = bpy.data.images.new("tiles", width, height)
    v, u = np.mgrid[0:height, 0:width]
    joint = (u % 16 == 0) | (v % 16 == 0)
    pixels = np.where(joint[..., None], 0.85, np.array([0.2, 0.55, 0.65])[None, None])
    tiles.pixels.foreach_set(np.concatenate([pixels, np.ones((height, width, 1))], axis=2).astype(np.float32).ravel())
    tiles.pack()
    tiled = matte("tiles", 1, 1, 1)
    texture = tiled.node_tree.nodes.new("ShaderNodeTexImage")
    texture.image = tiles
    tiled.node_tree.links.new(texture.outputs["Color"], tiled.node_tree.nodes["Principled BSDF"].inputs["Base Color"])
    basin = box("basin", (-2, -3, -1.5), (2, 3, 0.3), tiled, inwards=True)
    # Without its top.
    corners = [v.co[:] for v in basin.vertices]
    basin = mesh("basin", corners, [list(p.vertices) for p in basin.polygons if any(corners[i][2] < 0 for i in p.vertices)], tiled)
    layer = basin.uv_layers.new(name="uv")
    for polygon in basin.polygons:
        axes = sorted(range(3), key=lambda axis: abs(polygon.normal[axis]))[:2]
        for corner in polygon.loop_indices:
            place = basin.vertices[basin.loops[corner].vertex_index].co
            layer.uv[corner].vector = [place[axis] * 0.8 for axis in sorted(axes)]
    link("basin", basin)
    # Water from wall to wall, with waves above.
    count = 96
    grid = np.linspace(-1, 1, count)
    corners, faces = [], []
    for z in (None, -1.6):
        for y in grid:
            for x in grid:
                wave = 0.02 * math.sin(9 * x + 4 * y) + 0.015 * math.sin(13 * y - 5 * x + 1) + 0.008 * math.sin(31 * x + 17 * y)
                corners.append((2.05 * x, 3.05 * y, wave if z is None else z))
    top = lambda i, j: j * count + i
    low = lambda i, j: count * count + j * count + i
    last = count - 1
    for i in range(last):
        for j in range(last):
            faces.append((top(i, j), top(i + 1, j), top(i + 1, j + 1), top(i, j + 1)))
            faces.append((low(i, j), low(i, j + 1), low(i + 1, j + 1), low(i + 1, j)))
        faces.append((low(i, 0), low(i + 1, 0), top(i + 1, 0), top(i, 0)))
        faces.append((top(i, last), top(i + 1, last), low(i + 1, last), low(i, last)))
        faces.append((top(0, i), top(0, i + 1), low(0, i + 1), low(0, i)))
        faces.append((low(last, i), low(last, i + 1), top(last, i + 1), top(last, i)))
    water = glass("water", 1.33, ((0.6, 0.9, 0.95), 0.15))
    link("water", mesh("water", corners, faces, water, True))
    lamp("SUN", 4, (0, 0, 5), (1.2, 1.5, 0), angle=math.radians(0.53))
    camera((0.3, -4.6, 2.6), (0, -0.3, -0.7), 32)


def ring():
    world((0.03, 0.03, 0.03))
    link("table", board("table", 1, matte("paper", 0.7, 0.7, 0.7)))
    gold = material("gold", Base_Color=(1, 0.72, 0.3, 1), Metallic=1, Roughness=0.05)
    link("ring", torus("ring", 0.1, 0.008, gold, flat=3), (0, 0, 0.024))
    lamp("SPOT", 40, (0.45, 0.5, 0.45), (0, 0, 0.02), spot_size=math.radians(40), spot_blend=0.5, shadow_soft_size=0.01)
    camera((0, -0.4, 0.35), (0, 0, 0.01), 55)


def diamond():
    world((0.05, 0.05, 0.06))
    link("table", board("table", 1, matte("velvet", 0.6, 0.6, 0.62)))
    outline = [(0, -0.43), (0.5, -0.01), (0.5, 0.01), (0.28, 0.16), (0, 0.16)]
    stone = lathe("diamond", [(0.1 * r, 0.1 * h) for r, h in outline], glass("diamond", 2.42), sides=16, smooth=False)
    link("diamond", stone, (0, 0, 0.0365), turn=(math.radians(41), 0, 0.3))
    link("diamond", stone, (0.11, 0.05, 0.043))
    lamp("AREA", 6, (-0.4, 0.2, 0.6), (0, 0, 0), size=0.05)
    camera((0.02, -0.36, 0.22), (0.035, 0.01, 0.02), 60, stop=4)


def bulb():
    world((0, 0, 0))
    walls = matte("walls", 0.7, 0.65, 0.6)
    link("room", box("room", (-0.5, -0.9, 0), (0.5, 0.5, 0.8), walls, inwards=True))
    link("bulb", sphere("bulb", 0.1, glass("glass"), inner=0.096), (0, 0, 0.35))
    link("filament", torus("filament", 0.02, 0.003, glowing("hot", (1, 0.7, 0.4), 1500)), (0, 0, 0.35), turn=(1.2, 0.3, 0))
    link("block", box("block", (0.15, -0.1, 0), (0.35, 0.1, 0.15), matte("blue", 0.3, 0.4, 0.7)))
    camera((0, -0.85, 0.4), (0, 0, 0.33), 30)


def whisky():
    width, height = 256, 128
    v, u = np.mgrid[0:height, 0:width]
    pixels = np.zeros((height, width, 4), np.float32)
    pixels[..., :3] = 0.12 + 0.3 * (v[..., None] / height) * np.array([0.7, 0.85, 1.0])
    pixels[(v > 70) & (v < 105) & (u > 150) & (u < 170), :3] = (60, 54, 45)
    pixels[(v > 75) & (v < 95) & (u > 30) & (u < 60), :3] = (6, 8, 10)
    pixels[..., 3] = 1
    image = bpy.data.images.new("studio", width, height, float_buffer=True)
    image.pixels.foreach_set(pixels.ravel())
    image.pack()
    made = world((0, 0, 0))
    texture = made.node_tree.nodes.new("ShaderNodeTexEnvironment")
    texture.image = image
    made.node_tree.links.new(texture.outputs["Color"], made.node_tree.nodes["Background"].inputs["Color"])
    link("table", board("table", 1, matte("table", 0.55, 0.5, 0.45)))
    link("glass", lathe("glass", tumbler(0.095, wall=0.004, base=0.018), glass("glass"), sides=96, smooth=False))
    spirit = glass("whisky", 1.36, ((0.95, 0.55, 0.1), 40))
    link("whisky", lathe("whisky", liquid(0.055, wall=0.004, base=0.018), spirit, smooth=False))
    camera((0.1, -0.36, 0.2), (0.01, 0, 0.035), 60)


def blinds():
    world((0.5, 0.7, 1), 0.6)
    walls = matte("walls", 0.75, 0.72, 0.68)
    # A room whose wall at x = 2 has a window: boards around it.
    room = box("room", (-2, -3, 0), (2, 2, 2.6), walls, inwards=True)
    corners = [v.co[:] for v in room.vertices]
    faces = [list(p.vertices) for p in room.polygons if not all(corners[i][0] > 0 for i in p.vertices)]
    link("room", mesh("room", corners, faces, walls))
    for name, low, high in (
        ("below", (2, -3, 0), (2.1, 2, 0.8)),
        ("above", (2, -3, 2.2), (2.1, 2, 2.6)),
        ("left", (2, 1.2, 0.8), (2.1, 2, 2.2)),
        ("right", (2, -3, 0.8), (2.1, -0.8, 2.2)),
    ):
        link(name, box(name, low, high, walls))
    link("pane", box("pane", (2.04, -0.85, 0.75), (2.05, 1.25, 2.25), glass("pane")))
    slat = box("slat", (-0.035, -1, -0.001), (0.035, 1, 0.001), matte("slat", 0.8, 0.8, 0.78))
    for i in range(23):
        link("slat", slat, (1.95, 0.2, 0.82 + 0.06 * i), turn=(0, math.radians(25), 0))
    link("ball", sphere("ball", 0.25, glass("ball")), (0.7, 0.3, 0.25))
    link("table", box("block", (-1.2, 0.6, 0), (-0.4, 1.4, 0.7), matte("red", 0.7, 0.25, 0.2)))
    lamp("SUN", 20, (5, 0, 5), (1.4, 0.1, 2), angle=math.radians(0.53))
    camera((-1.2, -2.7, 1.5), (0.5, 0.6, 0.85), 24)


def chandelier():
    world((0.01, 0.01, 0.012))
    walls = matte("walls", 0.7, 0.68, 0.65)
    link("room", box("room", (-1.5, -2.5, -1), (1.5, 1.5, 1.2), walls, inwards=True))
    outline = [(0, -0.09), (0.022, -0.03), (0.012, 0.01), (0, 0.03)]
    drop = lathe("drop", outline, glass("crystal", 1.6), sides=8, smooth=False)
    brass = material("brass", Base_Color=(0.9, 0.7, 0.35, 1), Metallic=1, Roughness=0.15)
    for radius, height, count in ((0.42, 0.3, 26), (0.28, 0.17, 18), (0.14, 0.05, 10)):
        link("hoop", torus("hoop", radius, 0.006, brass), (0, 0, height + 0.04))
        for i in range(count):
            turn = 2 * math.pi * i / count
            link("drop", drop, (radius * math.cos(turn), radius * math.sin(turn), height), turn=(0, 0, turn))
    for i in range(6):
        turn = 2 * math.pi * (i + 0.5) / 6
        place = (0.33 * math.cos(turn), 0.33 * math.sin(turn), 0.42)
        lamp("POINT", 6, place, shadow_soft_size=0.02, color=(1, 0.8, 0.55), use_soft_falloff=False)
    camera((0, -2.3, 0.0), (0, 0, 0.12), 35)


SCENES = (glass_of_water, pool, ring, diamond, bulb, whisky, blinds, chandelier)

# ---- pictures


def render(engine, seconds, folder):
    """The picture, lines from the bottom, RGB, and the seconds that it took."""
    scene = bpy.context.scene
    scene.render.engine = engine
    scene.render.image_settings.file_format = "OPEN_EXR"
    scene.render.image_settings.color_depth = "32"
    scene.render.filepath = os.path.join(folder, f"{engine}.exr")
    if engine == "CYCLES":
        scene.cycles.samples = 1000000
        scene.cycles.time_limit = seconds
        scene.cycles.use_adaptive_sampling = False
        scene.cycles.use_denoising = False
    else:
        scene.ppm_vk.iterations = 0
        scene.ppm_vk.time = seconds
        scene.ppm_vk.save_every = 1000
    begin = time.monotonic()
    bpy.ops.render.render(write_still=True)
    took = time.monotonic() - begin
    image = bpy.data.images.load(scene.render.filepath)
    width, height = image.size
    pixels = np.array(image.pixels[:], np.float32).reshape(height, width, -1)[..., :3]
    bpy.data.images.remove(image)
    return pixels, took


def save_sheet(pictures, path, columns=4):
    """Pictures of one size; the exposure of each pair is such that the mean of its darker 95 % is a fifth."""
    shown = []
    for pair in zip(pictures[::2], pictures[1::2]):
        exposure = 0.2 / max(1e-6, np.clip(pair[0], 0, np.quantile(pair[0], 0.95)).mean())
        shown += [np.clip(picture * exposure, 0, 1) for picture in pair]
    while len(shown) % columns:
        shown.append(np.zeros_like(shown[0]))
    rows = [np.concatenate(shown[i : i + columns], axis=1) for i in range(0, len(shown), columns)]
    linear = np.concatenate(rows[::-1], axis=0)
    encoded = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * np.maximum(linear, 1e-9) ** (1 / 2.4) - 0.055)
    height, width, _ = encoded.shape
    image = bpy.data.images.new("sheet", width, height)
    image.pixels.foreach_set(np.concatenate([encoded, np.ones((height, width, 1))], axis=2).astype(np.float32).ravel())
    image.filepath_raw = os.path.abspath(path)
    image.file_format = "PNG"
    image.save()


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("sheet")
    parser.add_argument("--seconds", type=float, default=30)
    parser.add_argument("--size", default="320x240")
    parser.add_argument("--only", nargs="*")
    parser.add_argument("--save")
    options = parser.parse_args()
    ppm_vk.register()
    pictures = []
    with tempfile.TemporaryDirectory() as folder:
        for make in SCENES:
            if options.only and make.__name__ not in options.only:
                continue
            bpy.ops.wm.read_factory_settings(use_empty=True)
            render_settings = bpy.context.scene.render
            render_settings.resolution_x, render_settings.resolution_y = (int(part) for part in options.size.split("x"))
            make()
            if options.save:
                bpy.ops.wm.save_as_mainfile(filepath=os.path.join(os.path.abspath(options.save), f"{make.__name__}.blend"))
            for engine in ("PPM_VK", "CYCLES"):
                picture, took = render(engine, options.seconds, folder)
                pictures.append(picture)
                print(f"{make.__name__} {engine}: {took:.1f} s, mean {picture.mean():.4g}", flush=True)
        save_sheet(pictures, options.sheet)


if __name__ == "__main__":
    main()
