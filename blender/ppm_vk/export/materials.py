"""Copies of materials in the form that Blender's exporter understands, and what it drops of them."""

import math

import bpy

MARK = "ppm_vk"

_TRANSMISSION = "KHR_materials_transmission"
_VOLUME = "KHR_materials_volume"

# Nodes that the exporter follows.
_FOLLOWED = {
    "ATTRIBUTE", "BSDF_PRINCIPLED", "FRAME", "GROUP", "GROUP_INPUT", "GROUP_OUTPUT", "MAPPING", "MATH", "MIX", "NORMAL_MAP",
    "OUTPUT_MATERIAL", "REROUTE", "RGB", "SEPARATE_COLOR", "SEPXYZ", "TEX_COORD", "TEX_IMAGE", "TANGENT", "UVMAP", "VALUE",
    "VERTEX_COLOR", "COMBINE_COLOR", "VOLUME_ABSORPTION",
}  # fmt: skip
# Inputs of Principled that have no counterpart, and their values without effect.
_WITHOUT_COUNTERPART = {"Subsurface Weight": 0, "Thin Film Thickness": 0, "Diffuse Roughness": 0}


class Materials:
    def __init__(self, depsgraph, warnings):
        self._depsgraph = depsgraph
        self._warnings = warnings
        self._copies = {}
        self._entries = []

    def copy_of(self, material):
        """The copy of a material, or of Blender's default material for None."""
        key = material.name_full if material else None
        if key not in self._copies:
            self._copies[key] = self._copy(material)
        return self._copies[key]

    def _copy(self, material):
        if material is None:
            copy = bpy.data.materials.new("default")
            name = None
        else:
            copy = material.evaluated_get(self._depsgraph).copy()
            name = material.name
        entry = {"name": name, "absorption": None, "closed": True}
        copy[MARK] = len(self._entries)
        self._entries.append(entry)
        if not uses_nodes(copy):
            color, metallic, roughness = tuple(copy.diffuse_color), copy.metallic, copy.roughness
            copy.use_nodes = True
            copy.node_tree.nodes.clear()
            node = _Tree(copy.node_tree).new_principled()
            node.inputs["Base Color"].default_value = color
            node.inputs["Metallic"].default_value = metallic
            node.inputs["Roughness"].default_value = roughness
        else:
            self._simplify(copy, entry)
        return copy

    def _warn(self, entry, text):
        self._warnings.append(f"Material {entry['name']}: {text}")

    def _simplify(self, copy, entry):
        tree = _Tree(copy.node_tree)
        output = copy.node_tree.get_output_node("CYCLES")
        if output is None:
            tree.new_principled().inputs["Base Color"].default_value = (0, 0, 0, 1)
            return
        entry["absorption"] = self._absorption(output.inputs["Volume"], entry)
        if output.inputs["Displacement"].is_linked:
            self._warn(entry, "its displacement is left out")
        surface = node_at(output.inputs["Surface"])
        if surface is None:
            self._warn(entry, "it has no surface, which is black in ppm-vk")
            node = tree.new_principled()
            node.inputs["Base Color"].default_value = (0, 0, 0, 1)
            node.inputs["Specular IOR Level"].default_value = 0
        else:
            node = self._principled(tree, surface, entry)
        for link in list(output.inputs["Volume"].links):
            copy.node_tree.links.remove(link)
        if node is None:
            return
        copy.node_tree.links.new(node.outputs[0], output.inputs["Surface"])
        self._tint(node, entry)
        thin = node.inputs.get("Thin Wall")
        if thin and (thin.is_linked or thin.default_value):
            self._warn(entry, "its walls are thin only where the mesh is not closed")
        for name, none in _WITHOUT_COUNTERPART.items():
            socket = node.inputs.get(name)
            if socket and (socket.is_linked or socket.default_value != none):
                self._warn(entry, f"its «{name}» is left out")
        for other in tree.upstream(node):
            if other.type not in _FOLLOWED:
                self._warn(entry, f"its node «{other.name}» is left out")

    def _principled(self, tree, node, entry):
        """The Principled node that is a shader node's counterpart; None where the exporter must see to it."""
        kind = node.type
        if kind == "BSDF_PRINCIPLED":
            return node
        if kind == "GROUP":
            return None
        if kind in {"MIX_SHADER", "ADD_SHADER"}:
            return self._joined(tree, node, entry)
        new = tree.new_principled()
        inputs = node.inputs
        if kind == "EMISSION":
            new.inputs["Base Color"].default_value = (0, 0, 0, 1)
            new.inputs["Specular IOR Level"].default_value = 0
            tree.move(inputs["Color"], new.inputs["Emission Color"])
            tree.move(inputs["Strength"], new.inputs["Emission Strength"])
            return new
        if kind == "BSDF_TRANSPARENT":
            new.inputs["Alpha"].default_value = 0
            return new
        if "Color" in inputs:
            tree.move(inputs["Color"], new.inputs["Base Color"])
        if "Normal" in inputs and inputs["Normal"].is_linked:
            tree.move(inputs["Normal"], new.inputs["Normal"])
        if kind == "BSDF_DIFFUSE":
            new.inputs["Roughness"].default_value = 1
            new.inputs["Specular IOR Level"].default_value = 0
            return new
        if "Roughness" in inputs:
            tree.move(inputs["Roughness"], new.inputs["Roughness"])
        if kind in {"BSDF_GLOSSY", "BSDF_ANISOTROPIC", "BSDF_METALLIC"}:
            new.inputs["Metallic"].default_value = 1
            if kind == "BSDF_METALLIC" and "Base Color" in inputs:
                tree.move(inputs["Base Color"], new.inputs["Base Color"])
        elif kind in {"BSDF_GLASS", "BSDF_REFRACTION"}:
            new.inputs["Transmission Weight"].default_value = 1
            tree.move(inputs["IOR"], new.inputs["IOR"])
            new["tints_crossings"] = True
            if kind == "BSDF_REFRACTION":
                self._warn(entry, "its Refraction BSDF reflects, too")
        else:
            self._warn(entry, f"its node «{node.name}» is left out: the surface is matte")
            new.inputs["Roughness"].default_value = 1
            new.inputs["Specular IOR Level"].default_value = 0
        return new

    def _joined(self, tree, node, entry):
        shaders = [node_at(socket) for socket in node.inputs if socket.type == "SHADER"]
        factor = node.inputs["Fac"] if node.type == "MIX_SHADER" else None
        of_kind = [shader.type if shader else None for shader in shaders]
        if factor is None and "EMISSION" in of_kind:
            emission = shaders[of_kind.index("EMISSION")]
            other = shaders[1 - of_kind.index("EMISSION")]
            if other is None:
                return self._principled(tree, emission, entry)
            if other.type not in {"EMISSION", "MIX_SHADER", "ADD_SHADER"}:
                result = self._principled(tree, other, entry)
                if result:
                    tree.move(emission.inputs["Color"], result.inputs["Emission Color"])
                    tree.move(emission.inputs["Strength"], result.inputs["Emission Strength"])
                return result
        if factor is not None and "BSDF_TRANSPARENT" in of_kind:
            transparent = of_kind.index("BSDF_TRANSPARENT")
            other = shaders[1 - transparent]
            chosen_by = node_at(factor)
            if other and other.type != "BSDF_TRANSPARENT":
                result = self._principled(tree, other, entry)
                if chosen_by and chosen_by.type in {"LIGHT_PATH", "MATH"}:
                    # Transparent to shadow rays, where path tracers find no caustic; here the glass itself does it.
                    return result
                if result and chosen_by and transparent == 0:
                    tree.move(factor, result.inputs["Alpha"])
                elif result and not chosen_by:
                    share = factor.default_value
                    result.inputs["Alpha"].default_value = share if transparent == 0 else 1 - share
                elif result:
                    self._warn(entry, f"the factor of its node «{node.name}» is left out")
                return result
        chosen = 0
        if factor is not None and not factor.is_linked:
            chosen = int(factor.default_value >= 0.5)
        if shaders[chosen] is None:
            chosen = 1 - chosen
        if shaders[chosen] is None:
            return None
        if factor is None or factor.is_linked or 0 < factor.default_value < 1:
            self._warn(entry, f"of its node «{node.name}» only «{shaders[chosen].name}» is exported")
        return self._principled(tree, shaders[chosen], entry)

    def _tint(self, node, entry):
        """Blender's Principled glass tints by the root of its colour at each crossing, glTF's by the colour."""
        color, weight = node.inputs["Base Color"], node.inputs["Transmission Weight"]
        if node.get("tints_crossings") or weight.is_linked or weight.default_value == 0:
            return
        if color.is_linked:
            self._warn(entry, "its glass is tinted twice as much as in Blender: its colour comes from a node")
        elif weight.default_value == 1:
            color.default_value = [math.sqrt(max(0, part)) for part in color.default_value[:3]] + [1]

    def _absorption(self, socket, entry):
        """Radiance is multiplied by exp(−(1 − c)·d·x) on a way x: attenuation to a colour at a distance."""
        node = node_at(socket)
        if node is None:
            return None
        if node.type not in {"VOLUME_ABSORPTION", "PRINCIPLED_VOLUME"}:
            self._warn(entry, f"its node «{node.name}» is left out: ppm-vk has volumes that absorb only")
            return None
        if node.type == "PRINCIPLED_VOLUME":
            self._warn(entry, "its volume absorbs, and scatters not (Principled Volume)")
        if node.inputs["Color"].is_linked or node.inputs["Density"].is_linked:
            self._warn(entry, "its volume is left out: its colour or density is not constant")
            return None
        density = node.inputs["Density"].default_value
        color = node.inputs["Color"].default_value[:3]
        rates = [density * max(0, 1 - part) for part in color]
        if node.type == "PRINCIPLED_VOLUME":
            tint = node.inputs["Absorption Color"].default_value[:3]
            rates = [density * max(0, 1 - part) * max(0, 1 - math.sqrt(max(0, of))) for part, of in zip(color, tint)]
        largest = max(rates)
        if largest <= 0:
            return None
        return {"attenuationColor": [math.exp(-rate / largest) for rate in rates], "attenuationDistance": 1 / largest}

    def absorbs(self, copy):
        return self._entries[copy[MARK]]["absorption"] is not None

    def note_mesh(self, copy, closed):
        """A mesh has this copy as a material that absorbs."""
        self._entries[copy[MARK]]["closed"] &= closed

    def complete(self, document):
        """Adds to the file's materials what the exporter dropped, and restores their names."""
        for material in document.json.get("materials", ()):
            mark = document.take_mark(material, MARK)
            if mark is None:
                continue
            entry = self._entries[mark]
            if entry["name"] is None:
                material.pop("name", None)
            else:
                material["name"] = entry["name"]
            if entry["absorption"] is None:
                continue
            extensions = material.setdefault("extensions", {})
            if _TRANSMISSION not in extensions:
                self._warn(entry, "its volume is left out: its surface lets no light in")
            elif not entry["closed"]:
                self._warn(entry, "its volume is left out: its mesh is not closed")
            else:
                volume = extensions.setdefault(_VOLUME, {})
                volume.setdefault("thicknessFactor", 1)
                volume.update(entry["absorption"])
                document.use(_VOLUME)


class _Tree:
    def __init__(self, tree):
        self._tree = tree

    def new_principled(self):
        node = self._tree.nodes.new("ShaderNodeBsdfPrincipled")
        # The exporter takes a material's output by its links.
        output = self._tree.get_output_node("CYCLES") or self._tree.nodes.new("ShaderNodeOutputMaterial")
        self._tree.links.new(node.outputs[0], output.inputs["Surface"])
        return node

    def move(self, old, new):
        """The value of an input, or what is linked to it, at another node."""
        if old.is_linked:
            self._tree.links.new(old.links[0].from_socket, new)
        elif new.type == "RGBA" and old.type == "RGBA" or new.type == old.type == "VALUE":
            new.default_value = old.default_value
        elif new.type == "RGBA":
            new.default_value = [old.default_value] * 3 + [1]

    def upstream(self, node):
        """A node and all that feed it."""
        found, left = [], [node]
        while left:
            node = left.pop()
            if node not in found:
                found.append(node)
                left += [link.from_node for socket in node.inputs for link in socket.links]
        return found


def uses_nodes(block):
    """Whether a material, world or lamp has nodes; from Blender 5 on they have."""
    return bool(block.node_tree) and (bpy.app.version >= (5, 0, 0) or block.use_nodes)


def node_at(socket):
    """The node that feeds a socket."""
    while socket.is_linked:
        node = socket.links[0].from_node
        if node.type != "REROUTE":
            return node
        socket = node.inputs[0]
    return None
