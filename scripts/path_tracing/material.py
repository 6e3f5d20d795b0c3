"""glTF's materials as Mitsuba's BSDFs.

Glass with an inside is Mitsuba's own. All else is `Surface`, written from the specification: glTF 2.0, appendix B, with
KHR_materials_specular, _ior and _transmission. Mitsuba's own plastics and conductors have other Fresnel terms.
"""

from collections import namedtuple

import drjit as dr
import mitsuba as mi
import numpy as np

from . import gltf
from .gltf import SMOOTH_ALPHA

# Smallest α of microfacets where a texture has the roughness.
LEAST_ALPHA = 2e-3

Values = namedtuple("Values", "base metallic alpha f0 f90 transmission opacity")


class Look:
    """A mesh's material at its points: textures, and vertex colours."""

    all = []

    @staticmethod
    def of(props):
        return Look.all[props["look"]]

    def __init__(self, material, mesh):
        self.number = len(Look.all)
        Look.all.append(self)
        self.material = material
        self.has_color = mesh.colors is not None
        self.has_tangent = mesh.tangents is not None
        # Lights know but one set of coordinates.
        emission = material.textures.get("emission")
        self.set = emission.set if emission else min(mesh.texcoords, default=0)
        if material.has_emission() and self.is_see_through():
            color = material.textures.get("base_color")
            if self.has_color or (color and color.set != self.set):
                raise gltf.Unsupported(
                    f"material «{material.name}»: a lamp whose alpha is in vertex colours or has texture coordinates of its "
                    "own isn't supported"
                )
        self.textures = {slot: bitmap(texture, slot) for slot, texture in material.textures.items()}
        if "base_color" in material.textures:
            self.textures["alpha"] = bitmap(material.textures["base_color"], "alpha")
        if "specular" in material.textures:
            self.textures["specular"] = bitmap(material.textures["specular"], "alpha")

    def add_attributes(self, shape, mesh):
        hidden = np.full(mesh.positions.size // 3, self.material.hides_back(), np.float32)
        shape.add_attribute("vertex_hidden", 1, hidden)
        if self.has_color:
            shape.add_attribute("vertex_color", 3, mesh.colors[..., :3].ravel().astype(np.float32))
            shape.add_attribute("vertex_opacity", 1, mesh.colors[..., 3].ravel().astype(np.float32))
        if self.has_tangent:
            shape.add_attribute("vertex_tangent", 3, mesh.tangents[..., :3].ravel().astype(np.float32))
            shape.add_attribute("vertex_side", 1, mesh.tangents[..., 3].ravel().astype(np.float32))
        for number, coordinates in mesh.texcoords.items():
            padded = np.concatenate([coordinates, 0 * coordinates[..., :1]], axis=2)
            shape.add_attribute(f"vertex_set{number}", 3, padded.ravel().astype(np.float32))

    def is_see_through(self):
        return self.material.alpha_mode != "OPAQUE"

    def texture(self, slot, si, active, channels=3):
        """The value of a texture, or 1."""
        if slot not in self.textures:
            return mi.Color3f(1) if channels == 3 else mi.Float(1)
        texture = self.material.textures["base_color" if slot == "alpha" else slot]
        if texture.set != self.set:
            si = mi.SurfaceInteraction3f(si)
            coordinates = si.shape.eval_attribute_3(f"vertex_set{texture.set}", si, active)
            si.uv = mi.Point2f(coordinates.x, coordinates.y)
        bitmap = self.textures[slot]
        return bitmap.eval_3(si, active) if channels == 3 else bitmap.eval_1(si, active)

    def color(self, si, active):
        color = mi.Color3f(self.material.base_color) * self.texture("base_color", si, active)
        if self.has_color:
            color *= si.shape.eval_attribute_3("vertex_color", si, active)
        return color

    def opacity(self, si, active=True):
        if not self.is_see_through():
            return mi.Float(1)
        alpha = self.material.alpha * self.texture("alpha", si, active, 1)
        if self.has_color:
            alpha *= si.shape.eval_attribute_1("vertex_opacity", si, active)
        if self.material.alpha_mode == "MASK":
            return dr.select(alpha < self.material.alpha_cutoff, 0, mi.Float(1))
        return dr.clip(alpha, 0, 1)

    def emission(self, si, active):
        return mi.Color3f(self.material.emission) * self.texture("emission", si, active)

    def values(self, si, active):
        material = self.material
        ratios = self.texture("metallic_roughness", si, active)
        roughness, metallic = material.roughness * ratios.y, material.metallic * ratios.z
        alpha = dr.square(roughness)
        if not material.is_smooth():
            alpha = dr.maximum(alpha, LEAST_ALPHA)
        specular = material.specular * self.texture("specular", si, active, 1)
        of_ior = ((material.ior - 1) / (material.ior + 1)) ** 2
        color = mi.Color3f(material.specular_color) * self.texture("specular_color", si, active)
        transmission = material.transmission * self.texture("transmission", si, active).x
        base, opacity = self.color(si, active), self.opacity(si, active)
        return Values(base, metallic, alpha, dr.minimum(of_ior * color, 1) * specular, specular, transmission, opacity)

    def normal(self, si, active):
        """The shading normal in world space, with a normal texture."""
        normal = si.sh_frame.n
        if "normal" not in self.textures:
            return normal
        tangent = mi.Vector3f(si.shape.eval_attribute_3("vertex_tangent", si, active))
        side = si.shape.eval_attribute_1("vertex_side", si, active)
        tangent = dr.normalize(tangent - dr.dot(tangent, normal) * normal)
        bitangent = dr.sign(side) * dr.cross(normal, tangent)
        local = 2 * self.texture("normal", si, active) - 1
        scale = self.material.normal_scale
        leaning = dr.normalize(local.x * scale * tangent + local.y * scale * bitangent + local.z * normal)
        # One that leans under the surface says nothing.
        return dr.select(dr.dot(leaning, si.n) > 0, leaning, normal)


def bitmap(texture, slot):
    stream = mi.MemoryStream()
    stream.write(texture.data)
    stream.seek(0)
    image = mi.Bitmap(stream)
    if slot not in ("base_color", "emission", "specular_color"):
        image.set_srgb_gamma(False)
    linear = image.convert(mi.Bitmap.PixelFormat.RGBA, mi.Struct.Type.Float32, srgb_gamma=False)
    pixels = np.array(linear)
    pixels = pixels[..., 3:] if slot == "alpha" else pixels[..., :3]
    return mi.load_dict(
        {
            "type": "bitmap",
            "bitmap": mi.Bitmap(np.ascontiguousarray(pixels)),
            "raw": True,
            "filter_type": "nearest" if texture.nearest else "bilinear",
            "wrap_mode": texture.wrap[0],
            "to_uv": mi.ScalarTransform3f(np.vstack([texture.transform, [0, 0, 1]])),
        }
    )


def bsdf(look):
    material = look.material
    surface = {"type": "gltf", "look": look.number}
    if not material.is_solid():
        return surface
    clear = {
        "type": "dielectric" if material.is_smooth() else "roughdielectric",
        "int_ior": float(material.ior),
        "ext_ior": 1.0,
        "specular_transmittance": {"type": "rgb", "value": list(material.base_color)},
    }
    if look.has_color:
        raise gltf.Unsupported(f"material «{material.name}»: glass with an inside and vertex colours isn't supported")
    if "base_color" in look.textures:
        clear["specular_transmittance"] = scaled(material, "base_color", lambda pixels: pixels * material.base_color)
    if not material.is_smooth():
        clear["distribution"] = "ggx"
        clear["alpha"] = float(material.alpha_of(1))
        if "metallic_roughness" in look.textures:
            clear["alpha"] = scaled(
                material, "metallic_roughness", lambda pixels: np.maximum(material.alpha_of(pixels[..., 1:2]), LEAST_ALPHA)
            )
    if material.transmission == 1 and "transmission" not in look.textures:
        return clear
    share = float(material.transmission)
    if "transmission" in look.textures:
        share = scaled(material, "transmission", lambda pixels: pixels[..., :1] * material.transmission)
    return {"type": "blendbsdf", "weight": share, "surface": {**surface, "is_opaque": True}, "clear": clear}


def scaled(material, slot, change):
    """A texture of Mitsuba with changed texels."""
    texture = material.textures[slot]
    original = bitmap(texture, slot)
    pixels = np.array(mi.traverse(original)["data"])
    return mi.load_dict(
        {
            "type": "bitmap",
            "bitmap": mi.Bitmap(np.ascontiguousarray(change(pixels), dtype=np.float32)),
            "raw": True,
            "filter_type": "nearest" if texture.nearest else "bilinear",
            "wrap_mode": texture.wrap[0],
            "to_uv": mi.ScalarTransform3f(np.vstack([texture.transform, [0, 0, 1]])),
        }
    )


def schlick(f0, f90, cosine):
    one_minus = dr.clip(1 - cosine, 0, 1)
    return f0 + (f90 - f0) * (dr.square(dr.square(one_minus)) * one_minus)


def mirrored(direction):
    """On the other side of the surface."""
    return mi.Vector3f(direction.x, direction.y, -direction.z)


class Meeting:
    """A viewer's direction at a surface, in a frame whose normal is on the viewer's side."""

    def __init__(self, look, si, active):
        values = look.values(si, active)
        self.values = values
        self.is_smooth = look.material.is_smooth()
        viewer = si.to_world(si.wi)
        side = dr.sign(dr.dot(viewer, si.n))
        self.geometric = side * si.n
        shading = side * look.normal(si, active)
        # Past the horizon of the shading normal the true one takes its place.
        shading = dr.select(dr.dot(viewer, shading) > 0, shading, self.geometric)
        self.frame = mi.Frame3f(shading)
        self.v = self.frame.to_local(viewer)
        self.microfacets = mi.MicrofacetDistribution(mi.MicrofacetType.GGX, values.alpha)
        # Of the dielectric part a share is clear, and has the Fresnel term of its index; the rest has Schlick's.
        self.clear = values.transmission * (1 - values.metallic)
        self.ior = look.material.ior

    def fresnel(self, cosine):
        """Of the boundary, of the clear part; and between them what gets through to the base."""
        values = self.values
        of_dielectric = schlick(values.f0, mi.Color3f(values.f90), cosine)
        of_metal = schlick(values.base, mi.Color3f(1), cosine)
        of_clear = mi.fresnel(dr.clip(cosine, 0, 1), self.ior)[0]
        opaque = dr.maximum(1 - self.clear, 1e-6)
        metallic = dr.minimum(values.metallic / opaque, 1)
        mixed = dr.lerp(of_dielectric, of_metal, metallic)
        # The largest channel is what lies over the base, for all of them: KHR_materials_specular.
        base = (1 - metallic) * opaque * (1 - dr.max(of_dielectric))
        return opaque * mixed + self.clear * of_clear, base, of_clear

    def lobes(self, l):
        """BSDF times cosine of a direction in the frame, without delta lobes."""
        v, values = self.v, self.values
        is_above = l.z > 0
        up = dr.select(is_above, l, mirrored(l))
        h = dr.normalize(v + up)
        cosine = dr.dot(v, h)
        reflectance, base, of_clear = self.fresnel(cosine)
        reflected = base * values.base * (up.z / dr.pi)
        transmitted = mi.Color3f(0)
        if not self.is_smooth:
            density = self.microfacets.eval(h)
            a2 = dr.square(values.alpha)
            root_v = dr.sqrt(a2 + (1 - a2) * dr.square(v.z))
            root_l = dr.sqrt(a2 + (1 - a2) * dr.square(up.z))
            # Height-correlated masking above; apart on both sides of a thin wall.
            reflected += reflectance * (density * 0.5 * up.z / (up.z * root_v + v.z * root_l))
            apart = up.z / ((up.z + root_l) * (v.z + root_v))
            transmitted = (self.clear * (1 - of_clear) * density * apart) * values.base
        return dr.select(v.z > 0, dr.select(is_above, reflected, transmitted), 0)

    def probabilities(self):
        """Probabilities of reflection at the boundary, scattering in the base, transmission."""
        reflectance, base, of_clear = self.fresnel(self.v.z)
        reflects = dr.max(reflectance)
        scatters = base * dr.max(self.values.base)
        passes = dr.max(self.values.base) * self.clear * (1 - of_clear)
        reflects = dr.select(reflects > 0, dr.maximum(reflects, 0.25 * (reflects + scatters + passes)), 0)
        total = dr.maximum(reflects + scatters + passes, 1e-20)
        return reflects / total, scatters / total, passes / total

    def density(self, l):
        reflects, scatters, passes = self.probabilities()
        is_above = l.z > 0
        up = dr.select(is_above, l, mirrored(l))
        density = dr.select(is_above, scatters * up.z / dr.pi, 0)
        if not self.is_smooth:
            h = dr.normalize(self.v + up)
            of_lobe = self.microfacets.pdf(self.v, h) / (4 * dr.maximum(dr.dot(self.v, h), 1e-7))
            density += dr.select(is_above, reflects, passes) * of_lobe
        return dr.select(self.v.z > 0, density, 0)

    def leaves(self, l):
        """Whether a direction is on the same side of the geometric and the shading normal."""
        return dr.dot(self.frame.to_world(l), self.geometric) * l.z > 0


class Surface(mi.BSDF):
    """All of glTF's materials except solid glass."""

    def __init__(self, props):
        mi.BSDF.__init__(self, props)
        self.look = Look.of(props)
        material = self.look.material
        sides = mi.BSDFFlags.FrontSide | mi.BSDFFlags.BackSide
        components = [mi.BSDFFlags.DiffuseReflection | sides]
        if material.is_smooth() and not material.is_matte():
            components.append(mi.BSDFFlags.DeltaReflection | sides)
        else:
            components.append(mi.BSDFFlags.GlossyReflection | sides)
        self.is_thin = material.is_clear() and material.is_thin
        if props.get("is_opaque", False):
            # Beside glass with an inside: what isn't clear.
            self.is_thin = False
        if self.is_thin and not material.is_smooth():
            components.append(mi.BSDFFlags.GlossyTransmission | sides)
        if self.look.is_see_through() or (self.is_thin and material.is_smooth()):
            components.append(mi.BSDFFlags.Null | sides)
        self.m_components = components
        flags = components[0]
        for component in components[1:]:
            flags = flags | component
        self.m_flags = flags

    def meeting(self, si, active):
        meeting = Meeting(self.look, si, active)
        if not self.is_thin:
            meeting.clear = mi.Float(0)
        return meeting

    def sample(self, context, si, sample1, sample2, active=True):
        meeting = self.meeting(si, active)
        opacity, v = meeting.values.opacity, meeting.v
        is_there = sample1 < opacity
        chosen = sample1 / dr.maximum(opacity, 1e-20)
        reflects, scatters, passes = meeting.probabilities()
        is_reflected = chosen < reflects
        is_passed = ~is_reflected & (chosen >= reflects + scatters) & (passes > 0)
        base = mi.warp.square_to_cosine_hemisphere(sample2)
        if meeting.is_smooth:
            wo = dr.select(is_reflected, mi.Vector3f(-v.x, -v.y, v.z), dr.select(is_passed, -v, base))
            # Off an interpolated normal the mirror's direction may point into the surface.
            about_true = mi.reflect(meeting.frame.to_local(si.to_world(si.wi)), meeting.frame.to_local(meeting.geometric))
            wo = dr.select(is_reflected & ~meeting.leaves(wo), about_true, wo)
            is_delta = is_reflected | is_passed
        else:
            h, _ = meeting.microfacets.sample(v, sample2)
            lobe = mi.reflect(v, h)
            wo = dr.select(is_reflected, lobe, dr.select(is_passed, mirrored(lobe), base))
            is_delta = mi.Bool(False)
        pdf = meeting.density(wo)
        is_good = dr.select(is_delta, True, (pdf > 0) & meeting.leaves(wo) & (is_passed == (wo.z < 0)))
        weight = dr.select(is_good & ~is_delta, meeting.lobes(wo) / dr.maximum(pdf, 1e-30), 0)
        reflectance, _, of_clear = meeting.fresnel(v.z)
        mirror = reflectance / dr.maximum(reflects, 1e-20)
        through = meeting.values.base * (meeting.clear * (1 - of_clear) / dr.maximum(passes, 1e-20))
        weight = dr.select(is_delta, dr.select(is_reflected, mirror, through), weight)

        bs = dr.zeros(mi.BSDFSample3f)
        bs.wo = dr.select(is_there, si.to_local(meeting.frame.to_world(wo)), -si.wi)
        is_null = ~is_there | (is_delta & is_passed)
        bs.wo = dr.select(is_null, -si.wi, bs.wo)
        delta_pdf = dr.select(is_reflected, reflects, passes)
        bs.pdf = dr.select(is_there, opacity * dr.select(is_delta, delta_pdf, pdf), 1 - opacity)
        bs.eta = 1
        glossy = dr.select(is_reflected, +mi.BSDFFlags.GlossyReflection, +mi.BSDFFlags.GlossyTransmission)
        glossy = dr.select(is_reflected | is_passed, glossy, +mi.BSDFFlags.DiffuseReflection)
        kind = dr.select(is_delta, +mi.BSDFFlags.DeltaReflection, glossy)
        bs.sampled_type = mi.UInt32(dr.select(is_null, +mi.BSDFFlags.Null, kind))
        bs.sampled_component = 0
        weight = dr.select(is_there, weight, 1)
        return bs, dr.select(active & (is_good | ~is_there), weight, 0)

    def eval_pdf(self, context, si, wo, active=True):
        meeting = self.meeting(si, active)
        l = meeting.frame.to_local(si.to_world(wo))
        is_good = active & meeting.leaves(l)
        opacity = meeting.values.opacity
        value = dr.select(is_good, meeting.lobes(l) * opacity, 0)
        return value, dr.select(is_good, meeting.density(l) * opacity, 0)

    def eval(self, context, si, wo, active=True):
        return self.eval_pdf(context, si, wo, active)[0]

    def pdf(self, context, si, wo, active=True):
        return self.eval_pdf(context, si, wo, active)[1]

    def eval_null_transmission(self, si, active=True):
        passed = 1 - self.look.opacity(si, active)
        if not (self.is_thin and self.look.material.is_smooth()):
            return mi.Color3f(passed)
        meeting = self.meeting(si, active)
        of_clear = meeting.fresnel(meeting.v.z)[2]
        return passed + (1 - passed) * meeting.values.base * (meeting.clear * (1 - of_clear))

    def to_string(self):
        return f"Surface[{self.look.material.name}]"
