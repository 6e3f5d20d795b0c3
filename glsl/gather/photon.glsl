#include "layout.glsl"

uint object_of(vec4 position_object) {
    return floatBitsToUint(position_object.w) & ~CAUSTIC;
}

uint map_of(vec4 position_object) {
    return floatBitsToUint(position_object.w) >> 31u;
}
