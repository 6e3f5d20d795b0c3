#include "layout.glsl"

uint object_of(Photon photon) {
    return photon.object & ~CAUSTIC;
}

uint map_of(Photon photon) {
    return photon.object >> 31u;
}
