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
        meshes, cameras, lights, notes = gltf.load(arguments.scene)
        camera = choose(cameras, arguments.camera)
        if not arguments.environment and not lights and not any(mesh.material.has_emission() for mesh in meshes):
            notes.append("it has no light, and gets an environment of radiance 1")
            arguments.environment = (1.0, 1.0, 1.0)
        notes += lost_light(meshes, lights, arguments.light_tracing)
        if not arguments.output.parent.is_dir():
            raise gltf.Unsupported(f"there is no folder {arguments.output.parent} for the picture")
    except gltf.Unsupported as error:
        fail(f"{arguments.scene}: {error}")
    except OSError as error:
        fail(f"{error.filename}: {error.strerror}")
    except (KeyError, IndexError, ValueError, TypeError) as error:
        fail(f"{arguments.scene}: this is no glTF file, or a damaged one ({type(error).__name__}: {error})")
    for note in notes:
        print(f"reference: {arguments.scene}: {note}", file=sys.stderr)
    resolution = arguments.resolution or (256, max(1, round(256 / (camera.aspect or 1))))
    render(arguments, (meshes, camera, lights, arguments.environment), resolution)


def lost_light(meshes, lights, is_light_tracing):
    """Light that no camera path finds: delta lights by way of smooth surfaces."""
    specular = sorted({mesh.material.name for mesh in meshes if mesh.material.is_specular()})
    if not lights or not specular:
        return []
    where = "where it is seen by mirrors or glass" if is_light_tracing else "(--light-tracing finds some of it)"
    names = ", ".join(f"«{name}»" for name in specular)
    return [f"what {names} make of the punctual lights is missing {where}"]


def render(arguments, world, resolution):
    try:
        from . import render as rendering
        from . import scene as scenes

        scene, has_media = scenes.build(*world, resolution, is_traced_from_lights=arguments.light_tracing)
    except ImportError as error:
        fail(str(error))
    except gltf.Unsupported as error:
        fail(f"{arguments.scene}: {error}")
    import mitsuba

    pixels = np.arange(resolution[0] * resolution[1])
    if arguments.light_tracing:
        without, _ = scenes.build(*world, resolution, has_specular=False, is_traced_from_lights=True)
        groups = rendering.by_noise(scene, pixels, without)
        parts = [rendering.Caustics(scene, without, pixels)]
        for number, group in enumerate(groups, 1):
            parts.append(rendering.Paths(f"pixels {number}", scene, group, arguments.spp, without))
    else:
        parts = [rendering.Paths("pixels", scene, pixels, arguments.spp, has_media=has_media)]
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
        "rel_error_of_whole": [float(f"{error:.2g}") for error in estimate.error_of_whole()],
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
        "--environment",
        type=environment,
        metavar="FILE|R,G,B",
        help="light from all around, as ppm-vk has it: an equirectangular picture or one radiance",
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


def environment(text):
    try:
        radiance = tuple(float(value) for value in text.split(","))
    except ValueError:
        if Path(text).is_file():
            return Path(text)
        raise argparse.ArgumentTypeError(f"«{text}» is neither a file nor three numbers like 1,1,1") from None
    if len(radiance) != 3:
        raise argparse.ArgumentTypeError(f"«{text}» isn't like 1,1,1")
    return radiance


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
