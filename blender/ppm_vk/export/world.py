"""The world, which the exporter drops: a colour, or an equirectangular picture with strength and rotation."""

import os

import numpy as np

from .. import exr
from .materials import node_at, uses_nodes

# The program's environment at a rotation of 0 is turned by this against Blender's.
_QUARTER = 90


class Background:
    def __init__(self, depsgraph, warnings):
        self._warnings = warnings
        self._color = np.zeros(3)
        self._pixels = None
        self._rotation = 0.0
        self._strength = 1.0
        world = depsgraph.scene.world
        if world:
            self._read(world.evaluated_get(depsgraph))

    def _read(self, world):
        if not uses_nodes(world):
            self._color = np.array(world.color)
            return
        output = world.node_tree.get_output_node("CYCLES")
        if output and output.inputs["Volume"].is_linked:
            self._warnings.append("The world's volume is left out")
        node = node_at(output.inputs["Surface"]) if output else None
        if node is None:
            return
        if node.type not in {"BACKGROUND", "EMISSION"}:
            self._warnings.append(f"The world is black: its node «{node.name}» can't be exported, only a Background node")
            return
        if node.inputs["Strength"].is_linked:
            self._warnings.append("The node at «Strength» of the world is left out")
        self._strength = node.inputs["Strength"].default_value
        color = node.inputs["Color"]
        source = node_at(color)
        if source is None:
            self._color = np.array(color.default_value[:3])
        elif source.type == "RGB":
            self._color = np.array(source.outputs[0].default_value[:3])
        elif source.type == "TEX_ENVIRONMENT" and source.image:
            self._read_image(source)
        else:
            self._warnings.append(f"The world is black: its node «{source.name}» can't be exported, only a colour or an Environment Texture")

    def _read_image(self, node):
        if node.projection != "EQUIRECTANGULAR":
            self._warnings.append("The world's picture is taken as equirectangular")
        mapping = node_at(node.inputs["Vector"])
        if mapping is not None and mapping.type == "MAPPING":
            turn = mapping.inputs["Rotation"].default_value
            others = [*mapping.inputs["Location"].default_value, turn[0], turn[1]]
            if any(others) or any(part != 1 for part in mapping.inputs["Scale"].default_value):
                self._warnings.append("Of the world's Mapping node only the rotation about Z is exported")
            self._rotation = turn[2]
        elif mapping is not None and mapping.type != "TEX_COORD":
            self._warnings.append(f"The node «{mapping.name}» at the world's picture is left out")
        image = node.image
        width, height = image.size
        if not width:
            self._warnings.append(f"The world is black: its picture {image.filepath} can't be read")
            return
        pixels = np.empty(width * height * image.channels, np.float32)
        image.pixels.foreach_get(pixels)
        pixels = pixels.reshape(height, width, image.channels)
        pixels = np.repeat(pixels, 3, axis=2) if image.channels < 3 else pixels[..., :3]
        if not image.is_float and image.colorspace_settings.name == "sRGB":
            pixels = np.where(pixels <= 0.04045, pixels / 12.92, ((pixels + 0.055) / 1.055) ** 2.4)
        self._pixels = pixels

    def arguments(self, folder, is_dark):
        if self._pixels is None:
            radiance = self._color * self._strength
            if radiance.max() <= 0:
                # Without any light the program would light the scene by itself.
                return ["--environment=0,0,0"] if is_dark else []
            return ["--environment=" + ",".join(f"{part:.9g}" for part in radiance)]
        path = os.path.join(folder, "world.exr")
        exr.write(path, self._pixels[::-1])
        rotation = _QUARTER - np.degrees(self._rotation)
        return [f"--environment={path}", f"--environment-strength={self._strength:.9g}", f"--environment-rotation={rotation:.9g}"]

    def radiance(self, directions):
        """In directions of Blender's axes."""
        if self._pixels is None:
            return np.broadcast_to(self._color * self._strength, directions.shape)
        x, y, z = np.moveaxis(directions, -1, 0)
        turn = self._rotation
        x, y = x * np.cos(turn) - y * np.sin(turn), x * np.sin(turn) + y * np.cos(turn)
        height, width, _ = self._pixels.shape
        u = (-np.arctan2(y, x) / (2 * np.pi) + 0.5) % 1 * width - 0.5
        v = (np.arcsin(np.clip(z, -1, 1)) / np.pi + 0.5) * height - 0.5
        left, low = np.floor(u).astype(int), np.floor(v).astype(int)
        right_share, high_share = (u - left)[..., None], (v - low)[..., None]
        rows = [np.clip(low + i, 0, height - 1) for i in (0, 1)]
        columns = [(left + i) % width for i in (0, 1)]
        lines = [
            self._pixels[row, columns[0]] * (1 - right_share) + self._pixels[row, columns[1]] * right_share for row in rows
        ]
        return self._strength * (lines[0] * (1 - high_share) + lines[1] * high_share)

