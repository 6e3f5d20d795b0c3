"""Reads the part of glTF 2.0 that can be path-traced exactly; anything else is an Unsupported error, not a guess.

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
    """What the file needs that isn't here, or what is damaged in it: one line."""


@dataclass(frozen=True)
class Texture:
    data: bytes  # a PNG or JPEG file
    wrap: tuple  # of u and v: "repeat", "mirror" or "clamp"
    nearest: bool


@dataclass(frozen=True)
class Material:
    name: str
    kind: str  # "matte", "mirror" or "glass"
    base_color: tuple
    texture: Texture | None
    ior: float
    emission: tuple
    double_sided: bool


@dataclass
class Mesh:
    name: str
    material: Material
    positions: np.ndarray  # triangles × 3 corners × 3, counter-clockwise from the front
    normals: np.ndarray  # likewise, on the front
    texcoords: np.ndarray | None  # triangles × 3 corners × 2, v downwards


@dataclass
class Camera:
    names: tuple
    position: np.ndarray
    forward: np.ndarray
    up: np.ndarray
    yfov: float
    aspect: float | None


MATERIAL_EXTENSIONS = {
    "KHR_materials_emissive_strength",
    "KHR_materials_ior",
    "KHR_materials_specular",
    "KHR_materials_transmission",
    "KHR_materials_volume",
}
COMPONENTS = {5120: "i1", 5121: "u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}


def load(path, is_matte=False):
    """The meshes and cameras of the file's scene. With `is_matte` specular lobes over base colours are left out."""
    return Reader(Path(path), is_matte).read()


class Reader:
    def __init__(self, path, is_matte):
        self.folder = path.parent
        self.is_matte = is_matte
        data = path.read_bytes()
        self.chunk = None
        if data[:4] == b"glTF":
            length = struct.unpack_from("<I", data, 12)[0]
            self.chunk = data[28 + length :]
            data = data[20 : 20 + length]
        self.json = json.loads(data)
        for extension in self.json.get("extensionsRequired", []):
            if extension not in MATERIAL_EXTENSIONS:
                raise Unsupported(f"the file requires {extension}, which isn't supported")
        self.buffers = {}

    def read(self):
        meshes, cameras = [], []
        for node, to_world in self.nodes():
            name = node.get("name", "")
            if "camera" in node:
                camera = self.camera(self.json["cameras"][node["camera"]], node, to_world)
                cameras += [camera] if camera else []
            if "mesh" in node:
                mesh = self.json["meshes"][node["mesh"]]
                if "skin" in node or "weights" in mesh or "weights" in node:
                    raise Unsupported(f"node «{name}» has a skin or morph targets, which aren't supported")
                meshes += [self.mesh(primitive, name, to_world) for primitive in mesh["primitives"]]
        if not meshes:
            raise Unsupported("the scene has no meshes")
        if not cameras:
            raise Unsupported("the scene has no perspective camera")
        return meshes, cameras

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
            if node.get("extensions"):
                what = ", ".join(node["extensions"])
                raise Unsupported(f"node «{node.get('name', index)}» has {what}, which isn't supported")
            to_world = parent @ transform(node)
            yield node, to_world
            stack += [(child, to_world) for child in reversed(node.get("children", []))]

    def camera(self, camera, node, to_world):
        if camera["type"] != "perspective":
            return None
        # A camera ignores the node's scale, also where it mirrors.
        axes = to_world[:3, :3] * np.sign(node.get("scale", [1, 1, 1]))
        perspective = camera["perspective"]
        return Camera(
            names=(camera.get("name"), node.get("name")),
            position=to_world[:3, 3],
            forward=-axes[:, 2],
            up=axes[:, 1],
            yfov=perspective["yfov"],
            aspect=perspective.get("aspectRatio"),
        )

    # --- Geometry

    def mesh(self, primitive, name, to_world):
        attributes = primitive["attributes"]
        material = self.material(primitive.get("material"))
        if primitive.get("extensions") or primitive.get("targets"):
            raise Unsupported(f"mesh «{name}» is compressed, has variants or morph targets, which aren't supported")
        if "COLOR_0" in attributes:
            raise Unsupported(f"mesh «{name}» has vertex colours, which aren't supported")
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
            given = self.accessor(attributes["NORMAL"]).astype(float) @ np.linalg.inv(linear)
            given = given[corners]
            length = np.linalg.norm(given, axis=2, keepdims=True)
            given = given / np.where(length > 0, length, 1)
            # Normals that point to the back say nothing.
            is_good = np.einsum("tcx,tx->tc", given, face)[..., None] > 0
            normals = np.where(is_good, given, normals)
        texcoords = None
        if material.texture:
            if "TEXCOORD_0" not in attributes:
                raise Unsupported(f"mesh «{name}» has a texture, but no texture coordinates")
            texcoords = self.accessor(attributes["TEXCOORD_0"], is_normalised=True).astype(float)[corners]
        return Mesh(name, material, positions, normals, texcoords)

    def accessor(self, index, is_normalised=False):
        accessor = self.json["accessors"][index]
        if "sparse" in accessor or "bufferView" not in accessor:
            raise Unsupported(f"accessor {index} is sparse, which isn't supported")
        dtype = np.dtype(COMPONENTS[accessor["componentType"]])
        if accessor.get("normalized", False) and not (is_normalised and dtype.kind == "u"):
            raise Unsupported(f"accessor {index} is quantised, which isn't supported")
        width, count = WIDTHS[accessor["type"]], accessor["count"]
        view = self.json["bufferViews"][accessor["bufferView"]]
        stride = view.get("byteStride", dtype.itemsize * width)
        start = view.get("byteOffset", 0) + accessor.get("byteOffset", 0)
        data = self.buffer(view["buffer"])
        if count and start + stride * (count - 1) + dtype.itemsize * width > len(data):
            raise Unsupported(f"accessor {index} reaches past the end of its buffer")
        array = np.ndarray((count, width), dtype, data, start, (stride, dtype.itemsize))
        return array / np.iinfo(dtype).max if accessor.get("normalized", False) else array

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
        # A volume's thickness texture is for renderers that don't trace through the solid.
        slots = [json, pbr, transmission, specular]
        for slot in {key for slot in slots for key in slot if key.endswith("Texture")} - {"baseColorTexture"}:
            refuse(f"its {slot} isn't supported")
        if json.get("alphaMode", "OPAQUE") != "OPAQUE":
            refuse("it isn't opaque, which isn't supported")
        metallic, roughness = pbr.get("metallicFactor", 1.0), pbr.get("roughnessFactor", 1.0)
        transmitted = transmission.get("transmissionFactor", 0.0)
        ior = extensions.get("KHR_materials_ior", {}).get("ior", 1.5)
        if metallic not in (0, 1) or transmitted not in (0, 1):
            refuse("a metallicFactor or transmissionFactor between 0 and 1 isn't supported")
        if (metallic == 1 or transmitted == 1) and roughness > 0:
            refuse(f"rough metal and glass aren't supported (roughnessFactor {roughness})")
        if metallic == 1:
            kind = "mirror"
        elif transmitted == 1:
            kind = "glass"
            if volume.get("thicknessFactor", 0.0) == 0:
                refuse("transmission without a thickness is a thin wall, which isn't supported")
            if volume.get("attenuationColor", [1, 1, 1]) != [1, 1, 1] and "attenuationDistance" in volume:
                refuse("absorption isn't supported")
            if specular.get("specularFactor", 1.0) != 1 or "specularColorFactor" in specular or ior == 0:
                refuse("glass whose reflection doesn't follow from its index of refraction isn't supported")
        else:
            kind = "matte"
            if specular.get("specularFactor", 1.0) != 0 and not self.is_matte:
                refuse("a specular lobe over the base colour isn't supported (--matte leaves it out)")
        texture = self.texture(pbr["baseColorTexture"], refuse) if "baseColorTexture" in pbr else None
        if texture and kind != "matte":
            refuse("textures on metal and glass aren't supported")
        factor = strength.get("emissiveStrength", 1.0)
        return Material(
            name=name,
            kind=kind,
            base_color=tuple(pbr.get("baseColorFactor", [1, 1, 1, 1])[:3]),
            texture=texture,
            ior=ior,
            emission=tuple(factor * value for value in json.get("emissiveFactor", [0, 0, 0])),
            double_sided=json.get("doubleSided", False),
        )

    def texture(self, info, refuse):
        if info.get("texCoord", 0) != 0 or info.get("extensions"):
            refuse("texture transforms and second texture coordinates aren't supported")
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
        return Texture(data, wrap, nearest=sampler.get("magFilter") == 9728)


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

