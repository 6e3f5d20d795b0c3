// What the stages report to the host. Counters add up until the host clears them.
struct StatusCounters {
    uint photons_in_batch;    // that wanted to be stored, of the batch with the most
    uint lane_need;           // most photons that one invocation had to store
    uint truncated_paths;     // ended by max_depth
    uint cut_paths;           // ended by the driver's loop limit
    uint non_finite;          // values that were NaN or infinite and were left out
    uint overflow;            // 1: photons didn't fit; the iteration has to be done again
    uint photons_stored_low;  // of all batches, 64 bits
    uint photons_stored_high;
};

layout(std430) buffer Status { StatusCounters status; };

bool finite(vec3 v) {
    return !any(isnan(v)) && !any(isinf(v));
}
