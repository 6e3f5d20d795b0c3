#version 460
#extension GL_GOOGLE_include_directive : require
// Joins the photon regions of all lanes, in the order of lanes.

layout(local_size_x = 64) in;

#include "common/invocation.glsl"
#include "settings.glsl"
#include "gather/photon.glsl"
#include "common/status.glsl"

uniform usamplerBuffer LanePhotons;
layout(std430) readonly buffer LaneCounts { uint lane_counts[]; };
layout(std430) readonly buffer LaneOffsets { uint lane_offsets[]; };
layout(std430) readonly buffer ScanTotal { uint scan_total; };
layout(std430) writeonly buffer PhotonCount { uint photon_count; };
layout(std430) writeonly buffer Photons { Photon photons[]; };

void main() {
    uint i = invocation_index();
    if (i == 0u) {
        photon_count = min(scan_total, settings.photon_capacity);
        atomicMax(status.batch_need, scan_total);
        if (scan_total > settings.photon_capacity) {
            atomicOr(status.retry, PHOTONS_DID_NOT_FIT);
        }
        uint before = status.photons_stored_low;
        status.photons_stored_low = before + scan_total;
        status.photons_stored_high += before + scan_total < before ? 1u : 0u;
    }
    if (i >= settings.photon_lanes * settings.lane_capacity) {
        return;
    }
    uint lane = i % settings.photon_lanes;
    uint number = i / settings.photon_lanes;
    uint place = lane_offsets[lane] + number;
    if (number < lane_counts[lane] && place < settings.photon_capacity) {
        photons[place] = PHOTON(LanePhotons, i);
    }
}
