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
# With one thread, as where there is one core, Mitsuba 3.9.1 waits for ever for an OpenEXR file to be written.
dr.set_thread_count(max(2, dr.thread_count()))


class SchlickMirror(mi.BSDF):
    """A mirror on both sides. Its Fresnel term is Schlick's with the base colour at normal incidence: glTF 2.0,
    appendix B. Mitsuba's own conductors take complex indices of refraction."""

    def __init__(self, props):
        mi.BSDF.__init__(self, props)
        self.f0 = mi.Color3f(props["f0"])
        self.m_components = [mi.BSDFFlags.DeltaReflection | mi.BSDFFlags.FrontSide | mi.BSDFFlags.BackSide]
        self.m_flags = self.m_components[0]

    def sample(self, context, si, sample1, sample2, active=True):
        bs = dr.zeros(mi.BSDFSample3f)
        # Off an interpolated normal the mirror direction may point into the surface: then the true normal takes its place.
        geometric = si.to_local(si.n)
        side = dr.sign(dr.dot(si.wi, geometric))
        about_shading = mi.reflect(si.wi)
        about_geometric = 2 * dr.dot(si.wi, geometric) * geometric - si.wi
        is_good = (side * dr.dot(about_shading, geometric) > 0) & (side * si.wi.z > 0)
        bs.wo = dr.select(is_good, about_shading, about_geometric)
        cosine = dr.clip(dr.select(is_good, dr.abs(si.wi.z), side * dr.dot(si.wi, geometric)), 0, 1)
        bs.pdf = 1
        bs.eta = 1
        bs.sampled_type = +mi.BSDFFlags.DeltaReflection
        bs.sampled_component = 0
        one_minus = 1 - cosine
        power = dr.square(dr.square(one_minus)) * one_minus
        return bs, dr.select(active, self.f0 + (1 - self.f0) * power, 0)

    def eval(self, context, si, wo, active=True):
        return mi.Color3f(0)

    def pdf(self, context, si, wo, active=True):
        return mi.Float(0)

    def eval_pdf(self, context, si, wo, active=True):
        return mi.Color3f(0), mi.Float(0)

    def to_string(self):
        return f"SchlickMirror[{self.f0}]"


class Lamp(mi.Emitter):
    """An area light of uniform radiance that may emit on both sides (Mitsuba's own emit on the front alone), and that may
    aim half of the rays that start on it at a sphere."""

    def __init__(self, props):
        mi.Emitter.__init__(self, props)
        self.radiance = mi.Color3f(props["radiance"])
        self.double_sided = props["double_sided"]
        self.is_aimed = props.has_property("radius")
        if self.is_aimed:
            self.centre = mi.Point3f(props["centre"])
            self.radius = props["radius"]
        self.m_flags = +mi.EmitterFlags.Surface

    def emits(self, cosine):
        return cosine != 0 if self.double_sided else cosine > 0

    def eval(self, si, active=True):
        return dr.select(active & self.emits(si.wi.z), self.radiance, 0)

    def sample_direction(self, it, sample, active=True):
        ds = self.get_shape().sample_direction(it, sample, active)
        ds.emitter = mi.EmitterPtr(self)
        is_seen = active & (ds.pdf > 0) & self.emits(-dr.dot(ds.d, ds.n))
        return ds, dr.select(is_seen, self.radiance / ds.pdf, 0)

    def pdf_direction(self, it, ds, active=True):
        is_seen = active & self.emits(-dr.dot(ds.d, ds.n))
        return dr.select(is_seen, self.get_shape().pdf_direction(it, ds, active), 0)

    def eval_direction(self, it, ds, active=True):
        return dr.select(active & self.emits(-dr.dot(ds.d, ds.n)), self.radiance, 0)

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
        si = mi.SurfaceInteraction3f(ps, [])
        return si.spawn_ray(direction), self.radiance * weight

    def sample_wavelengths(self, si, sample, active=True):
        return mi.Color0f(), dr.select(active & self.emits(si.wi.z), self.radiance, 0)

    def to_string(self):
        return f"Lamp[{self.radiance}]"


mi.register_bsdf("schlick_mirror", SchlickMirror)
mi.register_emitter("lamp", Lamp)

BLACK = {"type": "diffuse", "reflectance": {"type": "rgb", "value": 0.0}}


def build(meshes, camera, resolution, has_specular=True, is_aimed=False):
    """The scene. Without `has_specular` mirrors and glass are black, so that no light is left that has met any.
    With `is_aimed` lights send half of their rays where mirrors and glass are.

    It is moved and scaled to the cube from -1 to 1 (lengths have no part in what is supported): Mitsuba's f32 is coarse
    far from the origin.
    """
    points = np.concatenate([mesh.positions.reshape(-1, 3) for mesh in meshes])
    lower, upper = points.min(axis=0), points.max(axis=0)
    centre, scale = (lower + upper) / 2, 2 / (upper - lower).max()
    position = (camera.position - centre) * scale
    specular = [mesh.positions.reshape(-1, 3) for mesh in meshes if mesh.material.kind != "matte"]
    aim = bounding_sphere((np.concatenate(specular) - centre) * scale) if is_aimed and specular else {}
    width, height = resolution
    scene = {
        "type": "scene",
        "sensor": {
            "type": "perspective",
            "to_world": mi.ScalarTransform4f().look_at(
                origin=position.tolist(), target=(position + camera.forward).tolist(), up=camera.up.tolist()
            ),
            "fov_axis": "y",
            "fov": float(np.degrees(camera.yfov)),
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
        },
    }
    with tempfile.TemporaryDirectory() as folder:
        for number, mesh in enumerate(meshes):
            file = Path(folder) / f"{number}.ply"
            write_ply(file, mesh, (mesh.positions - centre) * scale)
            material = mesh.material
            is_black = material.kind != "matte" and not has_specular
            scene[f"mesh{number}"] = {
                "type": "ply",
                "filename": str(file),
                "bsdf": {"type": "twosided", "bsdf": BLACK} if is_black else bsdf(material),
            }
            if max(material.emission) > 0:
                scene[f"mesh{number}"]["emitter"] = lamp(material, aim)
        # Optimised, lights that are alike become one, which can't belong to several shapes.
        return mi.load_dict(scene, optimize=False)


def bounding_sphere(points):
    centre = (points.min(axis=0) + points.max(axis=0)) / 2
    radius = np.linalg.norm(points - centre, axis=1).max()
    return {"centre": mi.ScalarPoint3f(centre), "radius": float(radius)}


def lamp(material, aim):
    if not material.double_sided and not aim:
        return {"type": "area", "radiance": {"type": "rgb", "value": list(material.emission)}}
    radiance = mi.ScalarColor3f(material.emission)
    return {"type": "lamp", "radiance": radiance, "double_sided": material.double_sided, **aim}


def bsdf(material):
    color = list(material.base_color)
    if material.kind == "mirror":
        return {"type": "schlick_mirror", "f0": mi.ScalarColor3f(color)}
    if material.kind == "glass":
        return {
            "type": "dielectric",
            "int_ior": float(material.ior),
            "ext_ior": 1.0,
            "specular_transmittance": {"type": "rgb", "value": color},
        }
    reflectance = {"type": "rgb", "value": color}
    if material.texture:
        reflectance = texture(material.texture, color)
    # In glTF doubleSided tells which sides are shown and emit; a ray tracer's surfaces reflect on both.
    return {"type": "twosided", "bsdf": {"type": "diffuse", "reflectance": reflectance}}


def texture(of, factor):
    if of.wrap[0] != of.wrap[1]:
        raise gltf.Unsupported("a texture that wraps differently in u and v isn't supported")
    stream = mi.MemoryStream()
    stream.write(of.data)
    stream.seek(0)
    bitmap = mi.Bitmap(stream)
    linear = bitmap.convert(mi.Bitmap.PixelFormat.RGB, mi.Struct.Type.Float32, srgb_gamma=False)
    return {
        "type": "bitmap",
        "bitmap": mi.Bitmap(np.array(linear) * np.array(factor, np.float32)),
        "raw": True,
        "filter_type": "nearest" if of.nearest else "bilinear",
        "wrap_mode": of.wrap[0],
    }


def write_ply(file, mesh, positions):
    names = ["x", "y", "z", "nx", "ny", "nz"]
    columns = [positions, mesh.normals]
    if mesh.texcoords is not None:
        names += ["u", "v"]
        columns.append(mesh.texcoords)
    vertices = np.concatenate(columns, axis=2).reshape(-1, len(names)).astype("<f4")
    faces = np.zeros(len(positions), dtype=[("count", "u1"), ("corners", "<u4", 3)])
    faces["count"] = 3
    faces["corners"] = np.arange(len(vertices)).reshape(-1, 3)
    header = ["ply", "format binary_little_endian 1.0", f"element vertex {len(vertices)}"]
    header += [f"property float {name}" for name in names]
    header += [f"element face {len(faces)}", "property list uchar uint vertex_indices", "end_header", ""]
    file.write_bytes("\n".join(header).encode() + vertices.tobytes() + faces.tobytes())
