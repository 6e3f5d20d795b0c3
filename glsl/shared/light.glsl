// Emissive triangles. Include after scene.glsl.
struct Light {
    uint triangle;
    float cumulative;  // probability of this light and those before it
    float probability; // nearly in proportion to its flux
    float area;        // render units²
};

uniform usamplerBuffer Lights;

Light light_at(uint i) {
    uvec4 bits = TEXEL_BITS(Lights, i);
    return Light(bits.x, uintBitsToFloat(bits.y), uintBitsToFloat(bits.z), uintBitsToFloat(bits.w));
}

// A light, and the part of [0, 1) that chooses it.
struct Choice {
    uint light;
    float before;
    float width;
};

// The light at u in [0, 1), by bisection of the cumulative probabilities.
Choice choose_light(float u) {
    uint low = 0u;
    uint high = settings.light_count - 1u;
    float before = 0.0;
    float end = 1.0;
    while (low < high) {
        uint middle = (low + high) / 2u;
        float cumulative = light_at(middle).cumulative;
        if (u < cumulative) {
            high = middle;
            end = cumulative;
        } else {
            low = middle + 1u;
            before = cumulative;
        }
    }
    return Choice(low, before, end - before);
}

bool emits(Material material, bool front) {
    return front || material.double_sided != 0u;
}
