"""Reads the part of glTF 2.0 that can be path-traced; anything else is an Unsupported error or a note, not a guess.

Triangles come out in world space, in f64, each with corners of its own.
"""

import base64
import json
import struct
import urllib.parse
from dataclasses import dataclass
from pathlib import Path

import numpy as np


class Unsupported(Exception):
    """A missing feature that the file needs, or a damage in it, in one line."""


@dataclass(frozen=True)
class Texture:
    data: bytes  # a PNG or JPEG file
    wrap: tuple  # of u and v: "repeat", "mirror" or "clamp"
    nearest: bool
    set: int  # which texture coordinates
    transform: np.ndarray  # 2 × 3, of the coordinates


@dataclass(frozen=True)
class Material:
    name: str
    base_color: tuple
    metallic: float
    roughness: float
    ior: float
    specular: float
    specular_color: tuple
    transmission: float
    is_thin: bool
    absorption: tuple  # 1/length
    emission: tuple
    double_sided: bool
    alpha_mode: str
    alpha: float
    alpha_cutoff: float
    textures: dict  # by slot: see SLOTS
    normal_scale: float

    def alpha_of(self, ratio):
        """Microfacets' α."""
        return (self.roughness * ratio) ** 2

    def is_smooth(self):
        return "metallic_roughness" not in self.textures and self.alpha_of(1) < SMOOTH_ALPHA

    def is_metal(self):
        return self.metallic == 1 and "metallic_roughness" not in self.textures

    def is_clear(self):
        return self.transmission > 0 and not self.is_metal()

    def is_solid(self):
        """Glass with an inside."""
        return self.is_clear() and not self.is_thin

    def hides_back(self):
        """Whether its back is culled for cameras. Glass is visible from both sides."""
        return not self.double_sided and not self.is_clear()

    def is_specular(self):
        """Whether it has a smooth boundary: light reaches it from one direction alone."""
        is_glossy = self.metallic > 0 or self.specular > 0 and self.ior != 1
        return self.is_smooth() and (self.is_clear() or is_glossy)

    def is_matte(self):
        return not self.is_clear() and self.metallic == 0 and self.specular == 0

    def has_emission(self):
        return max(self.emission) > 0


# Below this α a boundary is taken for a mirror.
SMOOTH_ALPHA = 1e-3


@dataclass
class Mesh:
    name: str
    material: Material
    positions: np.ndarray  # triangles × 3 corners × 3, counter-clockwise from the front
    normals: np.ndarray  # likewise, on the front
    texcoords: dict  # by set: triangles × 3 corners × 2, v downwards
    colors: np.ndarray | None  # triangles × 3 corners × 4
    tangents: np.ndarray | None  # triangles × 3 corners × 4, the last one the bitangent's side


@dataclass
class Camera:
    names: tuple
    position: np.ndarray
    forward: np.ndarray
    up: np.ndarray
    yfov: float | None
    ymag: float | None  # of an orthographic one: half of the height that it shows
    aspect: float | None


@dataclass
class Light:
    name: str
    kind: str  # "point", "spot" or "directional"
    intensity: np.ndarray  # candela, of a directional one lux
    position: np.ndarray
    direction: np.ndarray
    range: float | None
    cosines: tuple  # of a spot's inner and outer angle


MATERIAL_EXTENSIONS = {
    "KHR_materials_emissive_strength",
    "KHR_materials_ior",
    "KHR_materials_specular",
    "KHR_materials_transmission",
    "KHR_materials_volume",
}
EXTENSIONS = MATERIAL_EXTENSIONS | {"KHR_lights_punctual", "KHR_texture_transform"}
# Textures by their place in a material.
SLOTS = {
    "base_color": ("pbr", "baseColorTexture"),
    "metallic_roughness": ("pbr", "metallicRoughnessTexture"),
    "normal": ("json", "normalTexture"),
    "emission": ("json", "emissiveTexture"),
    "transmission": ("transmission", "transmissionTexture"),
    "specular": ("specular", "specularTexture"),
    "specular_color": ("specular", "specularColorTexture"),
}
# Of those that a path tracer has no use for.
UNUSED_TEXTURES = {"occlusionTexture", "thicknessTexture"}
COMPONENTS = {5120: "i1", 5121: "u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}


def load(path):
    """The meshes, cameras and punctual lights of the file's scene, and notes on deviations from the file."""
    return Reader(Path(path)).read()


class Reader:
    def __init__(self, path):
        self.folder = path.parent
        self.notes = []
        data = path.read_bytes()
        self.chunk = None
        if data[:4] == b"glTF":
            length = struct.unpack_from("<I", data, 12)[0]
            self.chunk = data[28 + length :]
            data = data[20 : 20 + length]
        self.json = json.loads(data)
        for extension in self.json.get("extensionsRequired", []):
            if extension not in EXTENSIONS:
                raise Unsupported(f"the file requires {extension}, which isn't supported")
        self.buffers = {}

    def read(self):
        meshes, cameras, lights = [], [], []
        if self.json.get("animations"):
            self.note("it has animations: everything is at rest")
        for node, to_world in self.nodes():
            name = node.get("name", "")
            if "camera" in node:
                cameras.append(self.camera(self.json["cameras"][node["camera"]], node, to_world))
            if "KHR_lights_punctual" in node.get("extensions", {}):
                lights.append(self.light(node["extensions"]["KHR_lights_punctual"]["light"], node, to_world))
            if "mesh" in node:
                mesh = self.json["meshes"][node["mesh"]]
                if "skin" in node or "weights" in mesh or "weights" in node:
                    raise Unsupported(f"node «{name}» has a skin or morph targets, which aren't supported")
                meshes += [self.mesh(primitive, name, to_world) for primitive in mesh["primitives"]]
        if not meshes:
            raise Unsupported("the scene has no meshes")
        if not cameras:
            self.note("it has no camera, and gets one that is framed on its bounds")
            cameras = [framed_on(np.concatenate([mesh.positions.reshape(-1, 3) for mesh in meshes]))]
        return meshes, cameras, lights, self.notes

    def note(self, what):
        if what not in self.notes:
            self.notes.append(what)

    # --- Nodes

    def nodes(self):
        """Each node of the scene with its global transform, parents first."""
        if "scenes" in self.json:
            roots = self.json["scenes"][self.json.get("scene", 0)].get("nodes", [])
        else:
            children = {child for node in self.json["nodes"] for child in node.get("children", [])}
            roots = [index for index in range(len(self.json["nodes"])) if index not in children]
        stack = [(root, np.eye(4)) for root in reversed(roots)]
        seen = set()
        while stack:
            index, parent = stack.pop()
            node = self.json["nodes"][index]
            if index in seen:
                raise Unsupported(f"node {index} has two parents or is its own ancestor")
            seen.add(index)
            others = node.get("extensions", {}).keys() - {"KHR_lights_punctual"}
            if others:
                what = ", ".join(sorted(others))
                raise Unsupported(f"node «{node.get('name', index)}» has {what}, which isn't supported")
            to_world = parent @ transform(node)
            yield node, to_world
            stack += [(child, to_world) for child in reversed(node.get("children", []))]

    def camera(self, camera, node, to_world):
        # A camera ignores the node's scale, also where it mirrors.
        axes = to_world[:3, :3] * np.sign(node.get("scale", [1, 1, 1]))
        lens = camera[camera["type"]]
        is_perspective = camera["type"] == "perspective"
        return Camera(
            names=(camera.get("name"), node.get("name")),
            position=to_world[:3, 3],
            forward=-axes[:, 2],
            up=axes[:, 1],
            yfov=lens["yfov"] if is_perspective else None,
            ymag=None if is_perspective else abs(lens["ymag"]),
            aspect=lens.get("aspectRatio") if is_perspective else abs(lens["xmag"] / lens["ymag"]),
        )

    def light(self, index, node, to_world):
        light = self.json["extensions"]["KHR_lights_punctual"]["lights"][index]
        spot = light.get("spot", {})
        angles = spot.get("innerConeAngle", 0.0), spot.get("outerConeAngle", np.pi / 4)
        # As of a camera, the node's scale turns nothing round.
        direction = -to_world[:3, 2] * np.sign(node.get("scale", [1, 1, 1]))[2]
        return Light(
            name=light.get("name", node.get("name", f"light {index}")),
            kind=light["type"],
            intensity=np.array(light.get("color", [1, 1, 1]), float) * light.get("intensity", 1.0),
            position=to_world[:3, 3],
            direction=direction / np.linalg.norm(direction),
            range=light.get("range"),
            cosines=tuple(np.cos(angles)),
        )

    # --- Geometry

    def mesh(self, primitive, name, to_world):
        attributes = primitive["attributes"]
        material = self.material(primitive.get("material"))
        if primitive.get("extensions") or primitive.get("targets"):
            raise Unsupported(f"mesh «{name}» is compressed, has variants or morph targets, which aren't supported")
        positions = self.accessor(attributes["POSITION"]).astype(float)
        count = len(positions)
        indices = self.accessor(primitive["indices"]).ravel() if "indices" in primitive else np.arange(count)
        corners = triangles(primitive.get("mode", 4), indices.astype(int), name)
        linear = to_world[:3, :3]
        if np.linalg.det(linear) < 0:
            corners = corners[:, ::-1]
        positions = (positions @ linear.T + to_world[:3, 3])[corners]
        face = np.cross(positions[:, 1] - positions[:, 0], positions[:, 2] - positions[:, 0])
        area = np.linalg.norm(face, axis=1)
        corners, positions, face = (array[area > 0] for array in (corners, positions, face))
        face = face / area[area > 0, None]
        normals = np.repeat(face[:, None], 3, axis=1)
        if "NORMAL" in attributes:
            given = self.accessor(attributes["NORMAL"], True).astype(float) @ np.linalg.inv(linear)
            given = given[corners]
            length = np.linalg.norm(given, axis=2, keepdims=True)
            given = given / np.where(length > 0, length, 1)
            # Normals that point to the back say nothing.
            is_good = np.einsum("tcx,tx->tc", given, face)[..., None] > 0
            normals = np.where(is_good, given, normals)
        texcoords, tangents = {}, None
        for texture in material.textures.values():
            attribute = f"TEXCOORD_{texture.set}"
            if attribute not in attributes:
                raise Unsupported(f"mesh «{name}» has a texture, but no {attribute}")
            texcoords[texture.set] = self.accessor(attributes[attribute], True).astype(float)[corners]
        if "normal" in material.textures:
            coordinates = texcoords[material.textures["normal"].set]
            tangents = tangents_of(positions, normals, coordinates)
            if "TANGENT" in attributes and "NORMAL" in attributes:
                given = self.accessor(attributes["TANGENT"], True).astype(float)
                side = np.sign(given[:, 3:]) * np.sign(np.linalg.det(linear))
                tangents = np.concatenate([given[:, :3] @ linear.T, side], axis=1)[corners]
        colors = None
        if "COLOR_0" in attributes:
            given = self.accessor(attributes["COLOR_0"], True).astype(float)
            colors = np.ones((len(given), 4))
            colors[:, : given.shape[1]] = given
            colors = colors[corners]
        return Mesh(name, material, positions, normals, texcoords, colors, tangents)

    def accessor(self, index, is_normalised=False):
        accessor = self.json["accessors"][index]
        if "sparse" in accessor or "bufferView" not in accessor:
            raise Unsupported(f"accessor {index} is sparse, which isn't supported")
        dtype = np.dtype(COMPONENTS[accessor["componentType"]])
        if accessor.get("normalized", False) and not is_normalised:
            raise Unsupported(f"accessor {index} is quantised, which isn't supported")
        width, count = WIDTHS[accessor["type"]], accessor["count"]
        view = self.json["bufferViews"][accessor["bufferView"]]
        stride = view.get("byteStride", dtype.itemsize * width)
        start = view.get("byteOffset", 0) + accessor.get("byteOffset", 0)
        data = self.buffer(view["buffer"])
        if count and start + stride * (count - 1) + dtype.itemsize * width > len(data):
            raise Unsupported(f"accessor {index} reaches past the end of its buffer")
        array = np.ndarray((count, width), dtype, data, start, (stride, dtype.itemsize))
        return np.maximum(array / np.iinfo(dtype).max, -1) if accessor.get("normalized", False) else array

    def buffer(self, index):
        if index not in self.buffers:
            uri = self.json["buffers"][index].get("uri")
            self.buffers[index] = self.chunk if uri is None else self.uri(uri)
        return self.buffers[index]

    def uri(self, uri):
        if uri.startswith("data:"):
            return base64.b64decode(uri.split(",", 1)[1])
        return (self.folder / urllib.parse.unquote(uri)).read_bytes()

    # --- Materials

    def material(self, index):
        json = {} if index is None else self.json["materials"][index]
        name = json.get("name", f"material {index}")

        def refuse(what):
            raise Unsupported(f"material «{name}»: {what}")

        extensions = json.get("extensions", {})
        for extension in extensions.keys() - MATERIAL_EXTENSIONS:
            refuse(f"{extension} isn't supported")
        pbr = json.get("pbrMetallicRoughness", {})
        transmission, specular, volume, strength = (
            extensions.get(f"KHR_materials_{which}", {})
            for which in ("transmission", "specular", "volume", "emissive_strength")
        )
        places = {"json": json, "pbr": pbr, "transmission": transmission, "specular": specular, "volume": volume}
        textures = {
            slot: self.texture(places[place][key], f"material «{name}»: its {key}", refuse)
            for slot, (place, key) in SLOTS.items()
            if key in places[place]
        }
        known = {key for _, key in SLOTS.values()} | UNUSED_TEXTURES
        for unknown in {key for place in places.values() for key in place if key.endswith("Texture")} - known:
            refuse(f"its {unknown} isn't supported")
        for key in UNUSED_TEXTURES & (json.keys() | volume.keys()):
            self.note(f"material «{name}»: its {key} is for renderers that don't trace light, and is left out")
        color = pbr.get("baseColorFactor", [1, 1, 1, 1])
        distance = volume.get("attenuationDistance", np.inf)
        kept = np.maximum(volume.get("attenuationColor", [1, 1, 1]), 1e-10)
        factor = strength.get("emissiveStrength", 1.0)
        material = Material(
            name=name,
            base_color=tuple(color[:3]),
            metallic=pbr.get("metallicFactor", 1.0),
            roughness=pbr.get("roughnessFactor", 1.0),
            ior=extensions.get("KHR_materials_ior", {}).get("ior", 1.5),
            specular=specular.get("specularFactor", 1.0),
            specular_color=tuple(specular.get("specularColorFactor", [1, 1, 1])),
            transmission=transmission.get("transmissionFactor", 0.0),
            is_thin=volume.get("thicknessFactor", 0.0) == 0,
            absorption=tuple(-np.log(kept) / distance),
            emission=tuple(factor * value for value in json.get("emissiveFactor", [0, 0, 0])),
            double_sided=json.get("doubleSided", False),
            alpha_mode=json.get("alphaMode", "OPAQUE"),
            alpha=color[3],
            alpha_cutoff=json.get("alphaCutoff", 0.5),
            textures=textures,
            normal_scale=json.get("normalTexture", {}).get("scale", 1.0),
        )
        self.check(material, refuse)
        return material

    def check(self, material, refuse):
        """Adds a note on a deviation from the file."""
        if material.ior == 0:
            refuse("an index of refraction of 0 isn't supported")
        if not material.is_clear():
            return
        if material.specular != 1 or material.specular_color != (1, 1, 1):
            self.note(f"material «{material.name}»: KHR_materials_specular on its clear part is left out")
        if material.is_solid():
            for slot in material.textures.keys() & {"normal", "emission"}:
                refuse(f"glass with an inside and a texture of its {slot} isn't supported")
            if material.alpha_mode != "OPAQUE":
                refuse("glass with an inside that isn't opaque by its alpha isn't supported")
            if material.metallic != 0:
                refuse("glass with an inside and a metallicFactor other than 0 isn't supported")

    def texture(self, info, what, refuse):
        transform = info.get("extensions", {}).get("KHR_texture_transform", {})
        for extension in info.get("extensions", {}).keys() - {"KHR_texture_transform"}:
            refuse(f"{extension} on a texture isn't supported")
        angle = transform.get("rotation", 0.0)
        (x, y), (w, h) = transform.get("offset", [0, 0]), transform.get("scale", [1, 1])
        rows = np.array([[np.cos(angle) * w, np.sin(angle) * h, x], [-np.sin(angle) * w, np.cos(angle) * h, y]])
        texture = self.json["textures"][info["index"]]
        sampler = self.json["samplers"][texture["sampler"]] if "sampler" in texture else {}
        image = self.json["images"][texture["source"]] if "source" in texture else refuse("its texture has no image")
        if "uri" in image:
            data = self.uri(image["uri"])
        else:
            view = self.json["bufferViews"][image["bufferView"]]
            start = view.get("byteOffset", 0)
            data = bytes(self.buffer(view["buffer"])[start : start + view["byteLength"]])
        wraps = {10497: "repeat", 33648: "mirror", 33071: "clamp"}
        wrap = tuple(wraps[sampler.get(axis, 10497)] for axis in ("wrapS", "wrapT"))
        if wrap[0] != wrap[1]:
            refuse(f"{what} wraps differently in u and v, which isn't supported")
        return Texture(
            data,
            wrap,
            nearest=sampler.get("magFilter") == 9728,
            set=transform.get("texCoord", info.get("texCoord", 0)),
            transform=rows,
        )


def tangents_of(positions, normals, coordinates):
    """Tangents where the file gives none, as MikkTSpace has them: those of the triangles around a corner of one position,
    normal and coordinates, each projected across the normal, weighed by the angles at the corner."""
    edges = positions[:, 1:] - positions[:, :1]
    across = coordinates[:, 1:] - coordinates[:, :1]
    area = across[:, 0, 0] * across[:, 1, 1] - across[:, 0, 1] * across[:, 1, 0]
    side = np.where(area >= 0, 1.0, -1.0)
    along = edges[:, 0] * across[:, 1, 1, None] - edges[:, 1] * across[:, 0, 1, None]
    along = (along * side[:, None])[:, None]
    along = unit(along - np.sum(along * normals, axis=2, keepdims=True) * normals)
    to_next, to_last = (unit(np.roll(positions, -step, axis=1) - positions) for step in (1, 2))
    angle = np.arccos(np.clip(np.sum(to_next * to_last, axis=2), -1, 1))
    sides = np.repeat(side[:, None], 3, axis=1)
    keys = np.concatenate([positions, normals, coordinates, sides[..., None]], axis=2).reshape(len(positions) * 3, -1)
    _, group = np.unique(keys, axis=0, return_inverse=True)
    group = group.ravel()
    sums = np.zeros((group.max() + 1, 3))
    np.add.at(sums, group, (along * angle[..., None]).reshape(-1, 3))
    # v runs down the picture, but the green of a normal texture points up it.
    return np.concatenate([unit(sums)[group].reshape(-1, 3, 3), -sides[..., None]], axis=2)


def unit(vectors):
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return vectors / np.where(length > 0, length, 1)


def framed_on(points):
    """The camera that ppm-vk gives to a scene without any: it looks 15° down along -Z, from where it sees all of the bounds
    in an angle of 40°, and 5 % further away."""
    pitch, tangent = np.radians(15), np.tan(np.radians(20))
    forward = np.array([0, -np.sin(pitch), -np.cos(pitch)])
    right = np.array([1.0, 0, 0])
    up = np.cross(right, forward)
    lower, upper = points.min(axis=0), points.max(axis=0)
    centre = (lower + upper) / 2
    signs = np.array(np.meshgrid(*[[-1, 1]] * 3)).reshape(3, -1).T
    offsets = signs * (upper - centre)
    reach = np.maximum(np.abs(offsets @ right), np.abs(offsets @ up))
    distance = max((reach / tangent - offsets @ forward).max(), 0) * 1.05
    return Camera(("framed on the bounds", None), centre - forward * distance, forward, up, np.radians(40), None, None)


def triangles(mode, indices, name):
    """Vertices of the corners of each triangle."""
    if mode == 4:
        return indices[: len(indices) // 3 * 3].reshape(-1, 3)
    steps = np.arange(max(len(indices) - 2, 0))
    if mode == 5:
        odd = steps % 2
        return indices[np.stack([steps, steps + 1 + odd, steps + 2 - odd], axis=1)]
    if mode == 6:
        return indices[np.stack([steps + 1, steps + 2, 0 * steps], axis=1)]
    raise Unsupported(f"mesh «{name}» has points or lines, which aren't supported")


def transform(node):
    if "matrix" in node:
        return np.array(node["matrix"], float).reshape(4, 4).T
    x, y, z, w = node.get("rotation", [0, 0, 0, 1])
    rotation = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )
    matrix = np.eye(4)
    matrix[:3, :3] = rotation * node.get("scale", [1, 1, 1])
    matrix[:3, 3] = node.get("translation", [0, 0, 0])
    return matrix

