"""The picture's size and region, and the passes that Blender gets of the program's picture."""

import numpy as np

_COMPONENTS = "RGBAXYZW"


class Film:
    def __init__(self, scene, camera, background, can_crop):
        render = scene.render
        share = render.resolution_percentage / 100
        # As Blender rounds.
        self.whole = int(render.resolution_x * share), int(render.resolution_y * share)
        self.left, self.top = 0, 0
        self.width, self.height = self.whole
        if render.use_border:
            edges = [int(edge * self.whole[0]) for edge in (render.border_min_x, render.border_max_x)]
            self.left, self.width = edges[0], edges[1] - edges[0]
            # From below.
            edges = [int(edge * self.whole[1]) for edge in (render.border_min_y, render.border_max_y)]
            self.top, self.height = self.whole[1] - edges[1], edges[1] - edges[0]
        self._crops = can_crop and render.use_border
        self._transparent = render.film_transparent
        self._camera = camera
        self._background = background

    def arguments(self):
        arguments = [f"--resolution={self.whole[0]}x{self.whole[1]}"]
        if self._crops:
            arguments.append(f"--crop={self.left},{self.top},{self.width}x{self.height}")
        return arguments

    def passes(self, picture):
        """Blender's passes by name, of the region, lines from the top."""
        groups = {}
        for name, plane in picture.channels.items():
            layer, component = _split(name)
            if (picture.width, picture.height) != (self.width, self.height):
                plane = plane[self.top : self.top + self.height, self.left : self.left + self.width]
            groups.setdefault(layer, {})[component] = plane
        passes = {}
        for name, components in groups.items():
            order = sorted(components, key=_COMPONENTS.index) if set(components) <= set(_COMPONENTS) else sorted(components)
            passes[name] = np.stack([components[component] for component in order], axis=-1)
        passes["Combined"] = self._combined(passes["Combined"])
        return passes

    def _combined(self, pixels):
        if pixels.shape[2] == 3:
            pixels = np.concatenate([pixels, np.ones_like(pixels[..., :1])], axis=2)
        if not self._transparent:
            pixels[..., 3] = 1
            return pixels
        # The program's picture has the environment behind the scene.
        behind = self._background.radiance(self._camera.directions(self))
        pixels[..., :3] = np.maximum(pixels[..., :3] - (1 - pixels[..., 3:]) * behind, 0)
        return pixels


def _split(name):
    """A channel's layer and component: error_R is R of Error, ViewLayer.Depth.Z is Z of Depth."""
    if name in ("R", "G", "B", "A"):
        return "Combined", name
    for separator in "._":
        layer, found, component = name.rpartition(separator)
        if found and component in tuple(_COMPONENTS):
            layer = layer.rpartition(".")[2]
            return layer[:1].upper() + layer[1:], component
    return name, "X"
