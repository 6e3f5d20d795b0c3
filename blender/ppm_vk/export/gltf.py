"""Changes to a glTF file that Blender's exporter wrote."""

import base64
import json

import numpy as np
from mathutils import Matrix

# Blender has z up, glTF y.
_UPRIGHT = Matrix(((1, 0, 0, 0), (0, 0, 1, 0), (0, -1, 0, 0), (0, 0, 0, 1)))


class Document:
    def __init__(self, path):
        self._path = path
        with open(path, encoding="utf-8") as file:
            self.json = json.load(file)

    def write(self):
        with open(self._path, "w", encoding="utf-8") as file:
            json.dump(self.json, file)

    def take_mark(self, entry, name):
        """Removes a custom property, and returns it."""
        extras = entry.get("extras", {})
        mark = extras.pop(name, None)
        if not extras:
            entry.pop("extras", None)
        return mark

    def append(self, kind, entry):
        """Its index."""
        entries = self.json.setdefault(kind, [])
        entries.append(entry)
        return len(entries) - 1

    def use(self, extension):
        used = self.json.setdefault("extensionsUsed", [])
        if extension not in used:
            used.append(extension)

    def add_node(self, name, matrix, **members):
        """A node of the scene, of a matrix in Blender's axes whose local axes keep their meaning."""
        columns = [value for column in (_UPRIGHT @ matrix).transposed() for value in column]
        node = self.append("nodes", {"name": name, "matrix": columns, **members})
        self.json["scenes"][self.json.get("scene", 0)].setdefault("nodes", []).append(node)

    def add_mesh(self, name, positions, triangles, material):
        """A mesh of positions in glTF's axes."""
        positions = np.asarray(positions, np.float32)
        triangles = np.asarray(triangles, np.uint32)
        data = positions.tobytes() + triangles.tobytes()
        uri = "data:application/octet-stream;base64," + base64.b64encode(data).decode()
        buffer = self.append("buffers", {"byteLength": len(data), "uri": uri})
        views = [
            self.append("bufferViews", {"buffer": buffer, "byteLength": positions.nbytes}),
            self.append("bufferViews", {"buffer": buffer, "byteOffset": positions.nbytes, "byteLength": triangles.nbytes}),
        ]
        of_positions = self.append(
            "accessors",
            {
                "bufferView": views[0],
                "componentType": 5126,
                "count": len(positions),
                "type": "VEC3",
                "min": positions.min(axis=0).tolist(),
                "max": positions.max(axis=0).tolist(),
            },
        )
        indices = self.append(
            "accessors", {"bufferView": views[1], "componentType": 5125, "count": triangles.size, "type": "SCALAR"}
        )
        primitive = {"attributes": {"POSITION": of_positions}, "indices": indices, "material": material}
        return self.append("meshes", {"name": name, "primitives": [primitive]})

    def is_dark(self):
        """Whether nothing in it emits light."""
        emits = any(any(material.get("emissiveFactor", ())) for material in self.json.get("materials", ()))
        return not emits and "KHR_lights_punctual" not in self.json.get("extensions", {})
