#version 460
#extension GL_GOOGLE_include_directive : require
// Looks up what a surface is at places of triangles, for tests.

layout(local_size_x = 64) in;

#include "common/invocation.glsl"
#include "settings.glsl"
#include "common/texel.glsl"
#include "common/random.glsl"
#include "trace/opacity.glsl"

layout(push_constant) uniform CountPush {
    uint count;
} push;

struct Asked {
    uint triangle;
    uint instance;
    float u;
    float v;
};

struct Found {
    vec4 position; // w: opacity
    vec4 geometric_normal;
    vec4 shading_normal;
    vec4 coat_normal;
    vec4 base_color; // w: roughness
    vec4 emission;   // w: metallic
    vec4 specular;   // f0; w: f90
    vec4 others;     // transmission, coat, roughness of the coat, anisotropy
    vec4 direction;  // of that
};

layout(std430) readonly buffer ProbeFrom { Asked asked[]; };
layout(std430) writeonly buffer ProbeTo { Found found[]; };

void main() {
    uint i = invocation_index();
    if (i >= push.count) {
        return;
    }
    Asked a = asked[i];
    Hit hit = hit_at(PlacedTriangle(a.triangle, a.instance), vec2(a.u, a.v));
    float there = opacity(hit);
    MaterialPoint point = material_point(hit);
    Surface surface = surface_at(hit);
    Material material = material_of(hit, point, surface);
    Found f;
    f.position = vec4(surface.position, there);
    f.geometric_normal = vec4(surface.geometric_normal, 0.0);
    f.shading_normal = vec4(surface.shading_normal, 0.0);
    f.coat_normal = vec4(surface.coat_normal, 0.0);
    f.base_color = vec4(material.base_color, material.roughness);
    f.emission = vec4(material.emission, material.metallic);
    f.specular = vec4(material.specular_f0, material.specular_f90);
    f.others = vec4(material.transmission, material.coat, material.coat_roughness, material.anisotropy);
    f.direction = vec4(decode_direction(material.anisotropy_direction), 0.0);
    found[i] = f;
}
