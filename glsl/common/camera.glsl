// The camera's rays. Include after settings.glsl and common/random.glsl.

layout(constant_id = 2) const bool JITTER = true;
layout(constant_id = 35) const bool FILTERED = false;
layout(constant_id = 19) const bool LENS = false;

// The place relative to the pixel's centre that belongs to a uniform number: PixelFilter::place of src/config/filter.rs.
float filter_place(float number) {
    float at = sqrt(max(1.0 - abs(2.0 * number - 1.0), 0.0)) * float(FILTER_PLACES - 1u);
    uint i = min(uint(at), FILTER_PLACES - 2u);
    float before = settings.filter_places[i / 4u][i % 4u];
    float behind = settings.filter_places[(i + 1u) / 4u][(i + 1u) % 4u];
    float distance = mix(before, behind, at - float(i));
    return number < 0.5 ? -distance : distance;
}

// Where in a pixel a camera path passes the film, from its upper left corner, in pixels.
vec2 place_in_pixel(vec2 u) {
    vec2 place = JITTER ? u : vec2(0.5);
    if (FILTERED) {
        place = JITTER ? 0.5 + vec2(filter_place(u.x), filter_place(u.y)) : place;
    }
    return place;
}

bool is_orthographic() {
    return settings.camera_up.w != 0.0;
}

// A ray through a point of the picture, in pixels, and of the lens, in its radius.
void camera_ray(vec2 film_point, vec2 lens_point, out vec3 origin, out vec3 direction) {
    vec2 film = film_point / vec2(settings.resolution) * 2.0 - 1.0;
    vec3 on_film = film.x * settings.camera_right.xyz - film.y * settings.camera_up.xyz;
    bool parallel = is_orthographic();
    origin = settings.camera_position.xyz + (parallel ? on_film : vec3(0.0));
    direction = settings.camera_forward.xyz + (parallel ? vec3(0.0) : on_film);
    float lens_radius = settings.camera_position.w;
    if (LENS && lens_radius > 0.0) {
        // All rays of a point of the picture meet in the plane of focus.
        vec2 on_lens = lens_radius * lens_point;
        vec3 off_axis = on_lens.x * normalize(settings.camera_right.xyz) + on_lens.y * normalize(settings.camera_up.xyz);
        origin += off_axis;
        direction = settings.camera_right.w * direction - off_axis;
    }
    direction = normalize(direction);
}

// The direction of view; a shift of the film leaves it as it is.
vec3 camera_axis() {
    return normalize(cross(settings.camera_up.xyz, settings.camera_right.xyz));
}

// The ray of a camera path.
void sample_camera_ray(uvec2 pixel, vec2 u, inout Random random, out vec3 origin, out vec3 direction) {
    vec2 lens_point = vec2(0.0);
    if (LENS && settings.camera_position.w > 0.0) {
        lens_point = disc_point(next4(random).xy);
    }
    camera_ray(vec2(pixel) + place_in_pixel(u), lens_point, origin, direction);
}
