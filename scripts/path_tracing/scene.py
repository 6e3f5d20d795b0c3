"""The glTF scene as one of Mitsuba's."""

import tempfile
from pathlib import Path

import drjit as dr
import mitsuba as mi
import numpy as np

from . import gltf

def start_mitsuba():
    try:
        mi.set_variant("llvm_ad_rgb")
        version = dr.detail.llvm_version()
    except ImportError:
        version = (0, 0, 0)
    # LLVM 15 and 16 can't compile the minima that path tracing has, and end the process.
    if version < (17, 0, 0):
        found = f"found {version[0]}" if version[0] else "found none"
        raise ImportError(f"Mitsuba needs LLVM's library, version 17 or newer ({found}): install libllvm19 or a newer one")


start_mitsuba()
from .material import Look, Surface, bsdf  # noqa: E402 (needs the variant)

# With one thread, as where there is one core, Mitsuba 3.9.1 waits for ever for an OpenEXR file to be written.
dr.set_thread_count(max(2, dr.thread_count()))


class Lamp(mi.Emitter):
    """An area light with a texture, which may emit on both sides (Mitsuba's own emit on the front alone), be there in part,
    and aim half of the rays that start on it at a sphere."""

    def __init__(self, props):
        mi.Emitter.__init__(self, props)
        self.look = Look.of(props)
        self.double_sided = self.look.material.double_sided
        self.is_aimed = props.has_property("radius")
        if self.is_aimed:
            self.centre = mi.Point3f(props["centre"])
            self.radius = props["radius"]
        self.m_flags = +mi.EmitterFlags.Surface

    def emits(self, cosine):
        return cosine != 0 if self.double_sided else cosine > 0

    def radiance(self, si, active=True):
        """The emission of a point without opacity, because a path that hits it can also pass it."""
        return self.look.emission(si, active)

    def share(self, ps, active=True):
        """The opacity at a point of a lamp, and the texture coordinates there."""
        si = mi.SurfaceInteraction3f(ps, [])
        return self.look.opacity(si, active), si

    def eval(self, si, active=True):
        # What lets a path pass has also been met by it.
        share = self.look.opacity(si, active)
        return dr.select(active & self.emits(si.wi.z), self.radiance(si, active) * share, 0)

    def sample_direction(self, it, sample, active=True):
        ds = self.get_shape().sample_direction(it, sample, active)
        ds.emitter = mi.EmitterPtr(self)
        is_seen = active & (ds.pdf > 0) & self.emits(-dr.dot(ds.d, ds.n))
        return ds, self.eval_direction(it, ds, is_seen) / dr.select(is_seen, ds.pdf, 1)

    def pdf_direction(self, it, ds, active=True):
        is_seen = active & self.emits(-dr.dot(ds.d, ds.n))
        return dr.select(is_seen, self.get_shape().pdf_direction(it, ds, active), 0)

    def eval_direction(self, it, ds, active=True):
        share, si = self.share(ds, active)
        return dr.select(active & self.emits(-dr.dot(ds.d, ds.n)), self.radiance(si, active) * share, 0)

    def sample_position(self, time, sample, active=True):
        ps = self.get_shape().sample_position(time, sample, active)
        return ps, dr.select(active & (ps.pdf > 0), dr.rcp(ps.pdf), 0)

    def sample_ray(self, time, sample1, sample2, sample3, active=True):
        ps, weight = self.sample_position(time, sample2, active)
        normal = ps.n
        if self.double_sided:
            normal = dr.select(sample1 < 0.5, normal, -normal)
            sample1 = 2 * dr.select(sample1 < 0.5, sample1, sample1 - 0.5)
            weight *= 2
        direction = mi.Frame3f(normal).to_world(mi.warp.square_to_cosine_hemisphere(sample3))
        if self.is_aimed:
            axis = self.centre - ps.p
            sine2 = dr.square(self.radius) / dr.squared_norm(axis)
            axis = dr.normalize(axis)
            is_outside = sine2 < 0.99
            least_cosine = dr.sqrt(1 - dr.select(is_outside, sine2, 0))
            in_cone = mi.Frame3f(axis).to_world(mi.warp.square_to_uniform_cone(sample3, least_cosine))
            direction = dr.select(is_outside & (sample1 < 0.5), in_cone, direction)
            cosine = dr.maximum(dr.dot(direction, normal), 0)
            hits = dr.dot(direction, axis) >= least_cosine
            cone_density = dr.select(hits, dr.rcp(2 * dr.pi * (1 - least_cosine)), 0)
            density = dr.select(is_outside, 0.5 * (cosine / dr.pi + cone_density), cosine / dr.pi)
            weight *= dr.select(density > 0, cosine / density, 0)
        else:
            weight *= dr.pi
        share, si = self.share(ps, active)
        return si.spawn_ray(direction), self.radiance(si, active) * (share * weight)

    def sample_wavelengths(self, si, sample, active=True):
        return mi.Color0f(), self.eval(si, active)

    def to_string(self):
        return f"Lamp[{self.look.material.name}]"


class Punctual(mi.Emitter):
    """A point light or a spot as KHR_lights_punctual recommends: a spot's intensity falls off with the square of a ramp in
    the cosine, and a range ends all light. Mitsuba's light has another falloff, and no range."""

    def __init__(self, props):
        mi.Emitter.__init__(self, props)
        self.position, self.axis = mi.Point3f(props["position"]), mi.Vector3f(props["direction"])
        self.intensity = mi.Color3f(props["intensity"])
        self.is_spot = props["is_spot"]
        # Edges as good as the same are a ten thousandth of the cone apart, as in ppm-vk.
        self.outer = props["outer"]
        self.inner = max(props["inner"], 1 - (1 - self.outer) * (1 - 1e-4))
        self.range = props["range"]
        self.m_flags = +mi.EmitterFlags.DeltaPosition

    def towards(self, direction):
        """Intensity."""
        if not self.is_spot:
            return self.intensity
        ramp = dr.clip((dr.dot(direction, self.axis) - self.outer) / (self.inner - self.outer), 0, 1)
        return self.intensity * dr.square(ramp)

    def sample_direction(self, it, sample, active=True):
        ds = dr.zeros(mi.DirectionSample3f)
        ds.p, ds.time, ds.pdf, ds.delta = self.position, it.time, 1, True
        ds.emitter = mi.EmitterPtr(self)
        ds.d = ds.p - it.p
        ds.dist = dr.norm(ds.d)
        ds.d /= ds.dist
        ds.n = -ds.d
        return ds, dr.select(active, self.eval_direction(it, ds, active), 0)

    def eval_direction(self, it, ds, active=True):
        value = self.towards(-ds.d) / dr.square(ds.dist)
        if self.range > 0:
            value *= dr.clip(1 - (ds.dist / self.range) ** 4, 0, 1)
        return dr.select(active, value, 0)

    def pdf_direction(self, it, ds, active=True):
        return mi.Float(0)

    def eval(self, si, active=True):
        return mi.Color3f(0)

    def sample_ray(self, time, sample1, sample2, sample3, active=True):
        # Light tracing: of lights without a range alone.
        least_cosine = self.outer if self.is_spot else -1.0
        direction = mi.Frame3f(self.axis).to_world(mi.warp.square_to_uniform_cone(sample3, least_cosine))
        weight = self.towards(direction) * (2 * dr.pi * (1 - least_cosine))
        return mi.Ray3f(self.position, direction, time, []), dr.select(active, weight, 0)

    def sample_wavelengths(self, si, sample, active=True):
        return mi.Color0f(), mi.Color3f(0)

    def to_string(self):
        return f"Punctual[{self.position}]"


mi.register_bsdf("gltf", Surface)
mi.register_emitter("lamp", Lamp)
mi.register_emitter("punctual", Punctual)

BLACK = {"type": "twosided", "bsdf": {"type": "diffuse", "reflectance": {"type": "rgb", "value": 0.0}}}


def build(meshes, camera, lights, environment, resolution, has_specular=True, is_traced_from_lights=False):
    """The scene, and whether paths have to handle absorption or partial opacity.

    Without `has_specular` mirrors and glass are black, so that no light is left that has met any. Where rays are traced
    from lights, half of them go where mirrors and glass are.

    It is moved and scaled to the cube from -1 to 1: Mitsuba's f32 is coarse far from the origin.
    """
    points = np.concatenate([mesh.positions.reshape(-1, 3) for mesh in meshes])
    lower, upper = points.min(axis=0), points.max(axis=0)
    centre, scale = (lower + upper) / 2, 2 / (upper - lower).max()
    specular = [mesh.positions.reshape(-1, 3) for mesh in meshes if mesh.material.is_specular()]
    aim = {}
    if is_traced_from_lights and specular:
        aim = bounding_sphere((np.concatenate(specular) - centre) * scale)
    scene = {"type": "scene", "sensor": sensor(camera, (camera.position - centre) * scale, scale, resolution)}
    for number, light in enumerate(lights):
        if light.range and is_traced_from_lights:
            raise gltf.Unsupported(f"light «{light.name}» has a range, which isn't supported with --light-tracing")
        scene[f"light{number}"] = punctual(light, (light.position - centre) * scale, scale)
    if environment:
        scene["environment"] = surroundings(environment)
    has_media = False
    with tempfile.TemporaryDirectory() as folder:
        for number, mesh in enumerate(meshes):
            material = mesh.material
            look = Look(material, mesh)
            file = Path(folder) / f"{number}.ply"
            write_ply(file, mesh, (mesh.positions - centre) * scale, look.set)
            shape = {"type": "ply", "filename": str(file)}
            shape["bsdf"] = BLACK if material.is_specular() and not has_specular else bsdf(look)
            if material.has_emission():
                shape["emitter"] = {"type": "lamp", "look": look.number, **aim}
            has_media |= look.is_see_through() or (material.is_clear() and material.is_thin and material.is_smooth())
            if material.is_solid() and max(material.absorption) > 0:
                has_media = True
                most = max(material.absorption)
                shape["interior"] = {
                    "type": "homogeneous",
                    "albedo": {"type": "rgb", "value": 0.0},
                    "sigma_t": {"type": "rgb", "value": [value / most for value in material.absorption]},
                    "scale": most / scale,
                }
            loaded = mi.load_dict(shape, optimize=False)
            look.add_attributes(loaded, mesh)
            scene[f"mesh{number}"] = loaded
        # Optimised, lights that are alike become one, which can't belong to several shapes.
        return mi.load_dict(scene, optimize=False), has_media


def sensor(camera, position, scale, resolution):
    width, height = resolution
    to_world = mi.ScalarTransform4f().look_at(
        origin=position.tolist(), target=(position + camera.forward).tolist(), up=camera.up.tolist()
    )
    lens = {"type": "perspective", "fov_axis": "y", "fov": float(np.degrees(camera.yfov or 1)), "to_world": to_world}
    if camera.ymag:
        # Mitsuba's shows two units of width.
        half = float(camera.ymag * scale * width / height)
        lens = {"type": "orthographic", "to_world": to_world @ mi.ScalarTransform4f().scale([half, half, 1])}
    return {
        **lens,
        "near_clip": 1e-4,
        "far_clip": 1e4,
        "film": {
            "type": "hdrfilm",
            "width": width,
            "height": height,
            "pixel_format": "rgb",
            "component_format": "float32",
            "rfilter": {"type": "box"},
        },
        "sampler": {"type": "independent"},
    }


def punctual(light, position, scale):
    if light.kind == "directional":
        irradiance = {"type": "rgb", "value": light.intensity.tolist()}
        return {"type": "directional", "direction": light.direction.tolist(), "irradiance": irradiance}
    return {
        "type": "punctual",
        "position": mi.ScalarPoint3f(position),
        "direction": mi.ScalarVector3f(light.direction),
        "intensity": mi.ScalarColor3f(light.intensity * scale**2),
        "is_spot": light.kind == "spot",
        "inner": float(light.cosines[0]),
        "outer": float(light.cosines[1]),
        "range": float((light.range or 0) * scale),
    }


def surroundings(environment):
    if isinstance(environment, tuple):
        return {"type": "constant", "radiance": {"type": "rgb", "value": list(environment)}}
    # Upper edge +Y, centre +Z, -X to the right of it: as ppm-vk has it. But Mitsuba's uppermost and lowest rows lie at the
    # poles, and not half a row away: of finer rows that is little.
    picture = mi.Bitmap(str(environment)).convert(mi.Bitmap.PixelFormat.RGB, mi.Struct.Type.Float32, srgb_gamma=False)
    pixels = np.array(picture)
    for axis, mode in ((0, "edge"), (1, "wrap")):
        pixels = finer(pixels, axis, mode, max(1, 2048 // pixels.shape[axis]))
    return {"type": "envmap", "bitmap": mi.Bitmap(np.ascontiguousarray(pixels, dtype=np.float32))}


def finer(pixels, axis, mode, times):
    """So many times as many pixels along an axis, interpolated between their centres."""
    count = pixels.shape[axis]
    padded = np.pad(pixels, [(1, 1) if along == axis else (0, 0) for along in range(3)], mode=mode)
    at = (np.arange(count * times) + 0.5) / times + 0.5
    low = np.floor(at).astype(int)
    part = (at - low).reshape([-1 if along == axis else 1 for along in range(3)])
    return (1 - part) * padded.take(low, axis) + part * padded.take(low + 1, axis)


def bounding_sphere(points):
    centre = (points.min(axis=0) + points.max(axis=0)) / 2
    radius = np.linalg.norm(points - centre, axis=1).max()
    return {"centre": mi.ScalarPoint3f(centre), "radius": float(radius)}


def write_ply(file, mesh, positions, texture_set):
    names = ["x", "y", "z", "nx", "ny", "nz"]
    columns = [positions, mesh.normals]
    if mesh.texcoords:
        names += ["u", "v"]
        columns.append(mesh.texcoords[texture_set])
    vertices = np.concatenate(columns, axis=2).reshape(-1, len(names)).astype("<f4")
    faces = np.zeros(len(positions), dtype=[("count", "u1"), ("corners", "<u4", 3)])
    faces["count"] = 3
    faces["corners"] = np.arange(len(vertices)).reshape(-1, 3)
    header = ["ply", "format binary_little_endian 1.0", f"element vertex {len(vertices)}"]
    header += [f"property float {name}" for name in names]
    header += [f"element face {len(faces)}", "property list uchar uint vertex_indices", "end_header", ""]
    file.write_bytes("\n".join(header).encode() + vertices.tobytes() + faces.tobytes())
