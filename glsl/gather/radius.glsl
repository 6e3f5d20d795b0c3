// Equations 2 and 3. Include after two_float.glsl and gather.glsl.

float count_of(uint low, uint high) {
    return float(high) * 4294967296.0 + float(low);
}

void update_statistics(inout Statistics statistics, vec4 new_flux, uint new_photons, float alpha) {
    if (new_photons == 0u) {
        return;
    }
    // (N + αM) / (N + M), and 1 minus that, with N = α · accepted.
    float n = alpha * count_of(statistics.accepted_low, statistics.accepted_high);
    float m = float(new_photons);
    float rest = (n + alpha * m) / (n + m);
    float part = (1.0 - alpha) * m / (n + m);
    if (statistics.radius2_high * rest < SMALLEST_RADIUS2) {
        rest = 1.0;
        part = 0.0;
    }
    reduce_by(statistics.radius2_high, statistics.radius2_low, part, rest);
    add_to(statistics.flux_high.r, statistics.flux_low.r, new_flux.r);
    add_to(statistics.flux_high.g, statistics.flux_low.g, new_flux.g);
    add_to(statistics.flux_high.b, statistics.flux_low.b, new_flux.b);
    add_to(statistics.flux_high.w, statistics.flux_low.w, new_flux.w);
    reduce_by(statistics.flux_high.r, statistics.flux_low.r, part, rest);
    reduce_by(statistics.flux_high.g, statistics.flux_low.g, part, rest);
    reduce_by(statistics.flux_high.b, statistics.flux_low.b, part, rest);
    reduce_by(statistics.flux_high.w, statistics.flux_low.w, part, rest);
    uint low = statistics.accepted_low + new_photons;
    statistics.accepted_high += low < new_photons ? 1u : 0u;
    statistics.accepted_low = low;
}
