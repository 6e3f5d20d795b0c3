#version 460
#extension GL_GOOGLE_include_directive : require
// Evaluates and samples BSDFs, for tests.

layout(local_size_x = 64) in;

#include "common/invocation.glsl"
#include "settings.glsl"
#include "common/texel.glsl"
#include "common/random.glsl"
#include "trace/interaction.glsl"
#include "bsdf/bsdf.glsl"

layout(push_constant) uniform CountPush {
    uint count;
} push;

struct Asked {
    Material material;
    vec4 geometric; // normals of the triangle's front; w: index of refraction outside
    vec4 shading;
    vec4 coat;
    vec4 incoming; // w: wavelength, nm; 0: of all
    vec4 towards;  // to a light
    vec4 u;
};

struct Found {
    vec4 brdf;      // w: density of the direction by reflection
    vec4 scattered; // part of the flux; w: probability of reflection
    vec4 outgoing;  // w: index of refraction at the wavelength
    vec4 reflected; // w: reflectance
    vec4 refracted; // w: eta
    vec4 reflected_weight;
    vec4 refracted_weight;
    vec4 glass;
    vec4 layer; // factor of a chosen layer; w: whether it is the coat
    vec4 layer_normal;
};

layout(std430) readonly buffer ProbeFrom { Asked asked[]; };
layout(std430) writeonly buffer ProbeTo { Found found[]; };

void main() {
    uint i = invocation_index();
    if (i >= push.count) {
        return;
    }
    Asked a = asked[i];
    SurfaceInteraction met = no_interaction();
    Surface surface = met.surface;
    surface.geometric_normal = a.geometric.xyz;
    surface.shading_normal = a.shading.xyz;
    surface.coat_normal = a.coat.xyz;
    vec3 incoming = a.incoming.xyz;
    vec3 v = -incoming;
    vec3 l = a.towards.xyz;
    ShadingFrame frame = shading_frame(surface, incoming);
    vec3 n = frame.shading_normal;
    Material material = a.material;
    Found f;
    Material glossy = material;
    glossy.surface = GLOSSY_SURFACE;
    Bsdf bsdf = bsdf_of(glossy);
    Bsdf rough = bsdf;
    rough.alpha = max(bsdf.alpha, SMOOTH_ALPHA);
    f.brdf = vec4(evaluate_bsdf(bsdf, n, v, l), reflected_density(rough, n, v, l));
    vec3 outgoing = cosine_direction(frame.geometric_normal, a.u.zy);
    vec3 scattered = scatter(bsdf, frame, v, a.u, outgoing);
    f.scattered = vec4(scattered, reflection_probability(bsdf, dot(n, v)));
    Material glass = material;
    glass.ior = a.incoming.w > 0.0 ? ior_at(material, a.incoming.w) : material.ior;
    f.outgoing = vec4(outgoing, glass.ior);
    Boundary boundary = sample_dielectric(frame, incoming, glass, a.geometric.w, a.u.xy);
    f.reflected = vec4(boundary.reflected, boundary.reflectance);
    f.refracted = vec4(boundary.refracted, boundary.eta);
    f.reflected_weight = vec4(boundary.reflected_weight, 0.0);
    f.refracted_weight = vec4(boundary.refracted_weight, 0.0);
    f.glass = vec4(is_rough_glass(glass) ? evaluate_dielectric(frame, v, l, glass, a.geometric.w) : vec3(0.0), 0.0);
    met.surface = surface;
    met.material = material;
    met.frame = frame;
    float factor = choose_layer(met, incoming, a.u.z);
    bool is_coat = factor != 1.0 && met.material.coat == 0.0;
    f.layer = vec4(vec3(factor), is_coat ? 1.0 : 0.0);
    f.layer_normal = vec4(met.frame.shading_normal, 0.0);
    found[i] = f;
}
