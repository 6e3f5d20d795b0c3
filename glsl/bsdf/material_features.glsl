// What materials of the scene have: the rest is compiled out.
#ifndef BSDF_MATERIAL_FEATURES
#define BSDF_MATERIAL_FEATURES

layout(constant_id = 6) const bool MIRRORS = true;
layout(constant_id = 7) const bool DIELECTRICS = true;
layout(constant_id = 9) const bool GLOSSY = false;
layout(constant_id = 10) const bool ROUGH_GLASS = false;
layout(constant_id = 11) const bool THIN_WALLS = false;
layout(constant_id = 12) const bool PARTLY_CLEAR = false;
layout(constant_id = 16) const bool TEXTURED = false;
layout(constant_id = 18) const bool DISPERSION = false;
layout(constant_id = 21) const bool CLEARCOAT = false;
layout(constant_id = 22) const bool SPECULAR_GLASS = false;

#endif
