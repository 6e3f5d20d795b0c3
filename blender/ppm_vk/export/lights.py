"""Lamps. The exporter's units agree with Cycles' («Unitless»), but it drops area lamps, radii, a sun's angle and a spot's
smooth edge."""

import math

import numpy as np

from .materials import uses_nodes

PUNCTUAL = "KHR_lights_punctual"
# The program's own: radius of a point or spot, angle of a sun, smooth edge of a spot.
SHAPE = "PPMVK_light_shape"

_DISC_SIDES = 64


def add(document, depsgraph, warnings):
    lights = []
    for instance in depsgraph.object_instances:
        if instance.object.type == "LIGHT":
            _add(document, instance, lights, warnings)
    if lights:
        document.json.setdefault("extensions", {})[PUNCTUAL] = {"lights": lights}
        document.use(PUNCTUAL)


def _add(document, instance, lights, warnings):
    lamp = instance.object.data
    name = instance.object.original.name
    matrix = instance.matrix_world.copy()
    of_cycles = getattr(lamp, "cycles", None)
    if lamp.type == "AREA" and getattr(of_cycles, "is_portal", False):
        # It emits nothing, but tells a path tracer where a window is.
        return
    if not getattr(lamp, "use_shadow", True):
        warnings.append(f"{name} casts shadows (none in Blender)")
    linking = getattr(instance.object.original, "light_linking", None)
    if linking and (linking.receiver_collection or linking.blocker_collection):
        warnings.append(f"{name} lights all objects: light linking is left out")
    strength = _strength(lamp, name, matrix, warnings)
    if max(strength) <= 0:
        return
    if lamp.type == "AREA":
        _add_area(document, lamp, name, matrix, strength, warnings)
        return
    light = {"name": name, "type": {"POINT": "point", "SPOT": "spot", "SUN": "directional"}[lamp.type]}
    shape = {}
    if lamp.type == "SUN":
        intensity = strength
        shape["angle"] = lamp.angle
    else:
        intensity = [power / (4 * math.pi) for power in strength]
        shape["radius"] = lamp.shadow_soft_size
    if lamp.type == "SPOT":
        outer = lamp.spot_size / 2
        if outer > math.pi / 2:
            warnings.append(f"{name}: a spot of more than 180° is one of 180°")
            outer = math.pi / 2
        # The edge has a share of the cone in terms of 1 − cos.
        inner = math.acos(min(1, math.cos(outer) + (1 - math.cos(outer)) * lamp.spot_blend))
        light["spot"] = {"innerConeAngle": inner, "outerConeAngle": outer}
        shape["smooth"] = True
        if lamp.use_square:
            warnings.append(f"{name}: its cone is round (square in Blender)")
    brightest = max(intensity)
    light["color"] = [part / brightest for part in intensity]
    light["intensity"] = brightest
    shape = {key: value for key, value in shape.items() if value}
    if shape:
        light["extensions"] = {SHAPE: shape}
        document.use(SHAPE)
    lights.append(light)
    place, rotation, _ = matrix.decompose()
    upright = rotation.to_matrix().to_4x4()
    upright.translation = place
    document.add_node(name, upright, extensions={PUNCTUAL: {"light": len(lights) - 1}})


def _strength(lamp, name, matrix, warnings):
    """Power or irradiance, RGB."""
    energy = lamp.energy * 2 ** getattr(lamp, "exposure", 0)
    if not getattr(lamp, "normalize", True):
        energy *= lamp.area(matrix_world=matrix)
    color = np.array(lamp.color)
    if getattr(lamp, "use_temperature", False):
        color = color * np.array(lamp.temperature_color)
    emission = _emission_node(lamp)
    if emission:
        for socket in (emission.inputs["Color"], emission.inputs["Strength"]):
            if socket.is_linked:
                warnings.append(f"{name}: the node at «{socket.name}» of its emission is left out")
        color = color * np.array(emission.inputs["Color"].default_value[:3])
        energy *= emission.inputs["Strength"].default_value
    return [max(0.0, float(part)) * energy for part in color]


def _emission_node(lamp):
    if not uses_nodes(lamp):
        return None
    output = lamp.node_tree.get_output_node("CYCLES")
    links = output.inputs["Surface"].links if output else ()
    node = links[0].from_node if links else None
    return node if node and node.type == "EMISSION" else None


def _add_area(document, lamp, name, matrix, power, warnings):
    """A mesh that emits the radiance P / (π·A) to its front."""
    width = lamp.size
    height = lamp.size_y if lamp.shape in {"RECTANGLE", "ELLIPSE"} else lamp.size
    if lamp.shape in {"DISK", "ELLIPSE"}:
        turns = np.arange(_DISC_SIDES) * (2 * math.pi / _DISC_SIDES)
        # Of the ellipse's area.
        reach = 0.5 * math.sqrt(math.pi / (_DISC_SIDES / 2 * math.sin(2 * math.pi / _DISC_SIDES)))
        outline = np.stack([reach * np.cos(turns), reach * np.sin(turns)], axis=-1)
        # Of the same orientation as the square's, whose normal is −z.
        outline = outline[::-1]
    else:
        outline = np.array([[-0.5, -0.5], [-0.5, 0.5], [0.5, 0.5], [0.5, -0.5]])
    corners = np.concatenate([outline * (width, height), np.zeros((len(outline), 1))], axis=1)
    world = corners @ np.array(matrix.to_3x3()).T + np.array(matrix.translation)
    fan = np.array([[0, i, i + 1] for i in range(1, len(world) - 1)])
    sides = world[fan[:, 1:]] - world[fan[:, :1]]
    area = 0.5 * np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=-1).sum()
    if area <= 0:
        warnings.append(f"{name} is left out: it has no area")
        return
    if matrix.to_3x3().determinant() < 0:
        fan = fan[:, ::-1]
    if getattr(lamp, "spread", math.pi) < math.pi * 0.999:
        warnings.append(f"{name}: its spread is 180° ({math.degrees(lamp.spread):.0f}° in Blender)")
    radiance = [part / (math.pi * area) for part in power]
    brightest = max(radiance)
    material = {
        "name": name,
        "pbrMetallicRoughness": {"baseColorFactor": [0, 0, 0, 1], "metallicFactor": 0, "roughnessFactor": 1},
        "emissiveFactor": [part / brightest for part in radiance],
        "extensions": {
            "KHR_materials_emissive_strength": {"emissiveStrength": brightest},
            "KHR_materials_specular": {"specularFactor": 0},
        },
    }
    for extension in material["extensions"]:
        document.use(extension)
    # In glTF's axes.
    positions = np.stack([world[:, 0], world[:, 2], -world[:, 1]], axis=-1)
    mesh = document.add_mesh(name, positions, fan, document.append("materials", material))
    node = document.append("nodes", {"name": name, "mesh": mesh})
    document.json["scenes"][document.json.get("scene", 0)].setdefault("nodes", []).append(node)
