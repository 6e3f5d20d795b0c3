// Emissive triangles. Include after scene.glsl.
struct Light {
    uint triangle;
    float cumulative;  // probability of this light and those before it
    float probability; // in proportion to its flux
    float area;        // render units²
};

uniform usamplerBuffer Lights;

Light light_at(uint i) {
    uvec4 bits = TEXEL_BITS(Lights, i);
    return Light(bits.x, uintBitsToFloat(bits.y), uintBitsToFloat(bits.z), uintBitsToFloat(bits.w));
}

// The light at u in [0, 1), by bisection of the cumulative probabilities.
uint choose_light(float u) {
    uint low = 0u;
    uint high = settings.light_count - 1u;
    while (low < high) {
        uint middle = (low + high) / 2u;
        if (u < light_at(middle).cumulative) {
            high = middle;
        } else {
            low = middle + 1u;
        }
    }
    return low;
}

bool emits(Material material, bool front) {
    return front || material.double_sided != 0u;
}
