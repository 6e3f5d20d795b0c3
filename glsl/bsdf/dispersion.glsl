// Light of one wavelength. A path has none until it meets a boundary that bends each its own way; then it is chosen, evenly,
// and what the path carries is coloured so that all wavelengths together are white.
#ifndef BSDF_DISPERSION
#define BSDF_DISPERSION

#include "bsdf/material.glsl"

float lobe(float wavelength, float centre, float left, float right) {
    float t = (wavelength - centre) * (wavelength < centre ? left : right);
    return exp(-0.5 * t * t);
}

// The part of a wavelength in linear sRGB, whose mean over all is 1 for each channel. Colour matching functions: Wyman, Sloan and
// Shirley, «Simple Analytic Approximations to the CIE XYZ Color Matching Functions», JCGT 2(2), 2013. No channel can have
// less than nothing: what lies outside of sRGB is clipped.
vec3 color_of(float wavelength) {
    float x = 1.056 * lobe(wavelength, 599.8, 0.0264, 0.0323) + 0.362 * lobe(wavelength, 442.0, 0.0624, 0.0374) -
              0.065 * lobe(wavelength, 501.1, 0.0490, 0.0382);
    float y = 0.821 * lobe(wavelength, 568.8, 0.0213, 0.0247) + 0.286 * lobe(wavelength, 530.9, 0.0613, 0.0322);
    float z = 1.217 * lobe(wavelength, 437.0, 0.0845, 0.0278) + 0.681 * lobe(wavelength, 459.0, 0.0385, 0.0725);
    vec3 rgb = vec3(3.2404542 * x - 1.5371385 * y - 0.4985314 * z, -0.9692660 * x + 1.8760108 * y + 0.0415560 * z,
                    0.0556434 * x - 0.2040259 * y + 1.0572252 * z);
    return max(rgb, 0.0) * vec3(1.7051129, 2.5996478, 2.7578811);
}

// KHR_materials_dispersion: Cauchy's equation through the index at 587.56 nm, with Abbe number 20 / dispersion.
float ior_at(Material material, float wavelength) {
    float micrometres = wavelength * 1e-3;
    float spread = (material.ior - 1.0) * material.dispersion / 20.0;
    return max(material.ior + spread * (0.523655 / (micrometres * micrometres) - 1.5168), 1.0);
}

// Gives a path that meets a boundary a wavelength if it needs one and has none, and the boundary the index for it. Returns the
// factor of what the path carries.
vec3 disperse(inout Material material, inout float wavelength, inout Random random) {
    vec3 color = vec3(1.0);
    if (material.dispersion > 0.0) {
        if (wavelength == 0.0) {
            wavelength = mix(SHORTEST_WAVELENGTH, LONGEST_WAVELENGTH, next4(random).x);
            color = color_of(wavelength);
        }
        material.ior = ior_at(material, wavelength);
    }
    return color;
}

#endif
