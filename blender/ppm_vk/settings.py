"""The settings of a scene, the path of the program, and the arguments that they become."""

import shlex

import bpy
from bpy.props import BoolProperty, EnumProperty, FloatProperty, IntProperty, PointerProperty, StringProperty

# The add-on's name among the preferences: bl_ext.<repository>.ppm_vk where it is installed as an extension.
PACKAGE = __package__


class PpmVkPreferences(bpy.types.AddonPreferences):
    bl_idname = PACKAGE

    program: StringProperty(
        name="Program",
        description="The program ppm-vk. Empty: ppm-vk of the search path",
        subtype="FILE_PATH",
    )

    def draw(self, _context):
        self.layout.prop(self, "program")


def preferences():
    """The add-on's preferences; None where it was registered by a script."""
    addon = bpy.context.preferences.addons.get(PACKAGE)
    return addon.preferences if addon else None


class PpmVkSettings(bpy.types.PropertyGroup):
    iterations: IntProperty(
        name="Iterations",
        description="Stop after this number of iterations. 0: no limit; 64 if there is no other limit",
        default=64,
        min=0,
    )
    time: FloatProperty(
        name="Time Limit", description="Stop after this time. 0: no limit", default=0, min=0, subtype="TIME_ABSOLUTE", unit="TIME_ABSOLUTE"
    )
    target_error: FloatProperty(
        name="Target Error",
        description="Stop when the estimated relative error is at most this. 0: no limit",
        default=0,
        min=0,
        precision=4,
        step=1,
    )
    photons: IntProperty(name="Photons", description="Photon paths emitted in an iteration", default=100000, min=1)
    estimator: EnumProperty(
        name="Estimator",
        items=(
            ("sppm", "Stochastic", "New visible points in each iteration: antialiasing, depth of field, soft reflections"),
            ("ppm", "Classic", "Visible points found once, as in the paper"),
        ),
        default="sppm",
    )
    seed: IntProperty(name="Seed", description="The same seed gives the same picture on the same device", default=0, min=0)
    max_depth: IntProperty(name="Max Depth", description="Maximum number of bounces of a camera or photon path", default=64, min=1)
    denoise: BoolProperty(
        name="Denoise", description="Denoise with Open Image Denoise, where this computer has its library", default=False
    )
    device: StringProperty(name="Device", description="Vulkan device, by a part of its name or its index. Empty: the best")
    save_every: FloatProperty(
        name="Update Interval", description="Show the picture so far whenever this many seconds have passed", default=3, min=0.1
    )
    arguments: StringProperty(
        name="Arguments", description="Other arguments of the program, for example: --filter blackman-harris --alpha 0.7"
    )

    def to_arguments(self):
        arguments = [f"--photons={self.photons}", f"--estimator={self.estimator}", f"--seed={self.seed}"]
        arguments += [f"--max-depth={self.max_depth}", f"--save-every={self.save_every:g}"]
        for flag, limit in (("iterations", self.iterations), ("time", self.time), ("target-error", self.target_error)):
            if limit > 0:
                arguments.append(f"--{flag}={limit:g}" if flag != "iterations" else f"--{flag}={limit}")
        if self.device:
            arguments.append(f"--device={self.device}")
        if self.denoise:
            arguments.append("--denoise")
        return arguments + shlex.split(self.arguments)


CLASSES = (PpmVkPreferences, PpmVkSettings)


def register():
    bpy.types.Scene.ppm_vk = PointerProperty(type=PpmVkSettings)


def unregister():
    del bpy.types.Scene.ppm_vk
