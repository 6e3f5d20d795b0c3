"""The picture's size and region, and the passes that Blender gets of the program's picture."""

import numpy as np

_COMPONENTS = "RGBAXYZWV"


def whole_size(render):
    share = render.resolution_percentage / 100
    return int(render.resolution_x * share), int(render.resolution_y * share)


class Film:
    def __init__(self, scene, camera, background, can_crop):
        render = scene.render
        self.whole = whole_size(render)
        self.left, self.top, self.width, self.height = self.of_region(render)
        self._crops = can_crop and render.use_border
        self._transparent = render.film_transparent
        self._camera = camera
        self._background = background

    @staticmethod
    def of_region(render):
        """Left and upper edge, width and height of what is rendered, as Blender rounds."""
        width, height = whole_size(render)
        if not render.use_border:
            return 0, 0, width, height
        left, right = (int(edge * width) for edge in (render.border_min_x, render.border_max_x))
        # From below.
        low, high = (int(edge * height) for edge in (render.border_min_y, render.border_max_y))
        return left, height - high, right - left, high - low

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
        if found and component.upper() in tuple(_COMPONENTS):
            return _layer(layer), component.upper()
    return _layer(name), "X"


def _layer(name):
    name = name.rpartition(".")[2]
    return name[:1].upper() + name[1:]
