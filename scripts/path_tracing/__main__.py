"""Renders a glTF scene with Mitsuba 3, as a reference for ppm-vk: see tests/references/README.md."""

import argparse
import json
import math
import re
import sys
import time
from pathlib import Path

import numpy as np

from . import gltf


def main():
    arguments = parse()
    try:
        meshes, cameras = gltf.load(arguments.scene, arguments.matte)
        camera = choose(cameras, arguments.camera)
        if all(max(mesh.material.emission) == 0 for mesh in meshes):
            raise gltf.Unsupported("nothing in the scene emits light")
        if not arguments.output.parent.is_dir():
            raise gltf.Unsupported(f"there is no folder {arguments.output.parent} for the picture")
    except gltf.Unsupported as error:
        fail(f"{arguments.scene}: {error}")
    except OSError as error:
        fail(f"{error.filename}: {error.strerror}")
    except (KeyError, IndexError, ValueError, TypeError) as error:
        fail(f"{arguments.scene}: this is no glTF file, or a damaged one ({type(error).__name__}: {error})")
    resolution = arguments.resolution or (256, max(1, round(256 / (camera.aspect or 1))))
    render(arguments, meshes, camera, resolution)


def render(arguments, meshes, camera, resolution):
    try:
        from . import render as rendering
        from . import scene as scenes

        scene = scenes.build(meshes, camera, resolution, is_aimed=arguments.light_tracing)
    except ImportError as error:
        fail(str(error))
    except gltf.Unsupported as error:
        fail(f"{arguments.scene}: {error}")
    import mitsuba

    pixels = np.arange(resolution[0] * resolution[1])
    if arguments.light_tracing:
        without = scenes.build(meshes, camera, resolution, has_specular=False, is_aimed=True)
        groups = rendering.by_noise(scene, pixels, without)
        parts = [rendering.Caustics(scene, without, pixels)]
        for number, group in enumerate(groups, 1):
            parts.append(rendering.Paths(f"pixels {number}", scene, group, arguments.spp, without))
    else:
        parts = [rendering.Paths("pixels", scene, pixels, arguments.spp)]
    estimate = rendering.Estimate(parts)
    start = told = time.perf_counter()
    while estimate.go_on(arguments.spp, arguments.seconds):
        if estimate.has_error() and time.perf_counter() - told > 5:
            told = time.perf_counter()
            print(f"{told - start:.0f} s: relative error {100 * estimate.error():.2f} %", file=sys.stderr)

    mean = estimate.mean()
    report = {
        "scene": str(arguments.scene),
        "by": f"Mitsuba {mitsuba.__version__}",
        "spp": {part.name: part.spp() for part in estimate.parts} if arguments.light_tracing else parts[0].spp(),
        "seconds": round(time.perf_counter() - start, 1),
        "rel_rmse_of_mean": float(f"{estimate.error():.3g}"),
        "mean": [round(value, 6) for value in mean.mean(axis=0).tolist()],
    }
    picture = mitsuba.Bitmap(mean.reshape(resolution[1], resolution[0], 3).astype(np.float32))
    unfinished = arguments.output.with_suffix(".unfinished.exr")
    picture.write(str(unfinished))
    unfinished.replace(arguments.output)
    arguments.output.with_suffix(".json").write_text(json.dumps(report) + "\n")
    print(json.dumps(report))


def parse():
    parser = argparse.ArgumentParser(prog="scripts/reference", description=__doc__)
    parser.add_argument("scene", type=Path, help="a .gltf or .glb file")
    parser.add_argument("-o", "--output", type=Path, required=True, help="the OpenEXR picture; a .json is put beside it")
    parser.add_argument("--resolution", type=resolution, help="WxH (default: 256 wide at the camera's aspect ratio)")
    parser.add_argument("--camera", help="name or index (default: the scene's first)")
    parser.add_argument("--spp", type=float, default=math.inf, help="samples a pixel")
    parser.add_argument("--seconds", type=float, default=math.inf, help="stop after that time")
    parser.add_argument(
        "--light-tracing",
        action="store_true",
        help="trace what mirrors and glass throw on matte surfaces from the lights: for caustics of small lights",
    )
    parser.add_argument(
        "--matte",
        action="store_true",
        help="leave out the specular lobe that most glTF materials have over their base colour, as ppm-vk does",
    )
    arguments = parser.parse_args()
    if min(arguments.spp, arguments.seconds) == math.inf:
        arguments.spp = 1024
    return arguments


def resolution(text):
    match = re.fullmatch(r"([1-9]\d{0,4})x([1-9]\d{0,4})", text)
    if not match:
        raise argparse.ArgumentTypeError(f"«{text}» isn't like 640x480")
    return int(match[1]), int(match[2])


def choose(cameras, name_or_index):
    if name_or_index is None:
        return cameras[0]
    for camera in cameras:
        if name_or_index in camera.names:
            return camera
    if name_or_index.isdecimal() and int(name_or_index) < len(cameras):
        return cameras[int(name_or_index)]
    listed = ", ".join(str(camera.names[0] or camera.names[1]) for camera in cameras)
    raise gltf.Unsupported(f"there is no camera «{name_or_index}»; it has {listed}")


def fail(line):
    sys.exit(f"reference: {line}")


main()
