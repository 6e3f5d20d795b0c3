// What the stages report to the host. Counters add up until the host clears them.
struct StatusCounters {
    uint lane_need;           // most photons that one invocation had to store
    uint batch_need;          // most photons of a batch
    uint truncated_paths;     // ended by max_depth
    uint cut_paths;           // ended by the driver's loop limit
    uint non_finite;          // values that were NaN or infinite and were left out
    uint again;               // why the iteration has to be done again; 0: it needn't
    uint photons_stored_low;  // of all batches, 64 bits
    uint photons_stored_high;
    uint lost_photons;        // beyond the maximum that a user set for a grid cell
    uint full_cells;          // cells that had more
    uint photons_landed_low;  // where visible points could be, wanted or not; 64 bits
    uint photons_landed_high;
    uint photons_accepted_low; // by visible points of the picture, in all iterations; 64 bits
    uint photons_accepted_high;
};

layout(std430) buffer Status { StatusCounters status; };

// Reasons to do an iteration again, bits. `direct` and `update` do nothing where there is one.
const uint PHOTONS_DID_NOT_FIT = 1u;
const uint LANES_TOO_LONG = 2u;   // a lane's paths need more loop iterations than the driver gives
const uint GATHERS_TOO_LONG = 4u; // likewise a visible point's photons

bool finite(vec3 v) {
    return !any(isnan(v)) && !any(isinf(v));
}
