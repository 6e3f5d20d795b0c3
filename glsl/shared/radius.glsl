// Equations 2 and 3. Include after two_float.glsl and gather.glsl.

float count_of(uint low, uint high) {
    return float(high) * 4294967296.0 + float(low);
}

// 1 − (N + αM) / (N + M), the part of R² and τ that goes, with N = α · accepted. Written so that it keeps its precision
// when it is far smaller than 1.
float shrinking_part(float accepted, float new_photons, float alpha) {
    return (1.0 - alpha) * new_photons / (alpha * accepted + new_photons);
}

void update_statistics(inout Statistics statistics, vec3 new_flux, uint new_photons, float alpha) {
    if (new_photons == 0u) {
        return;
    }
    float part = shrinking_part(count_of(statistics.accepted_low, statistics.accepted_high), float(new_photons), alpha);
    reduce_by(statistics.radius2_high, statistics.radius2_low, part);
    add_to(statistics.flux_high.r, statistics.flux_low.r, new_flux.r);
    add_to(statistics.flux_high.g, statistics.flux_low.g, new_flux.g);
    add_to(statistics.flux_high.b, statistics.flux_low.b, new_flux.b);
    reduce_by(statistics.flux_high.r, statistics.flux_low.r, part);
    reduce_by(statistics.flux_high.g, statistics.flux_low.g, part);
    reduce_by(statistics.flux_high.b, statistics.flux_low.b, part);
    uint low = statistics.accepted_low + new_photons;
    statistics.accepted_high += low < new_photons ? 1u : 0u;
    statistics.accepted_low = low;
}
