// What stays the same through a render. Mirrors `layout::Settings`.
layout(std140) uniform Settings {
    vec4 camera_position;       // w: radius of the lens
    vec4 camera_right;          // scaled so that ±1 is the picture's edge; w: distance of what is in focus
    vec4 camera_up;             // likewise; w: 1 where rays are parallel
    vec4 camera_forward;        // to the picture's middle, at distance 1; w: unused
    uvec2 resolution;           // pixels
    uint slots_per_pixel;       // visible points a pixel
    uint seed;
    uint light_count;           // lights
    uint instance_count;
    uint max_depth;             // bounces of a path at the most
    uint triangle_count;        // that instances don't share: the first ones
    uint photon_lanes;          // invocations among which an iteration's photon paths are dealt
    uint lane_capacity;         // photons that an invocation can store
    uint photon_capacity;       // photons that a batch can store
    uint cell_bits;             // log2 of the cells of the hashed grid
    float alpha;                // eq. 2
    float initial_radius2;      // the user's R² before the first photon, render units; 0 where it follows the footprints
    uint loop_limit;            // iterations that all loops of an invocation may make together
    float bsdf_sampling;        // probability that direct light is sampled by a direction of the BSDF, near a light
    vec2 first_footprints;      // R before the first photon in footprints, global and caustic photons
    vec2 most_footprints;       // R at the most; 0: no bound
    uint photon_maps;           // 2 where caustic photons are gathered apart from the others, else 1
    float pixel_spread;         // side of a pixel's footprint at distance 1 along a path, or anywhere where rays are parallel
    float demand_floor2;        // beside the squared radiance where what visible points want of photons is weighed
    uint near_light_count;      // spheres in which a light is near
    uint light_source_count;    // sources that direct light is chosen from
    uint padding0;
    uint padding1;
    uint padding2;
    uvec4 camera_media;         // that the camera is in, see media.glsl
} settings;
