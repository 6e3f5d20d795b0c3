// Status that the stages report to the host. Counters add up until the host clears them.
#include "layout.glsl"

layout(std430) buffer Status { StatusCounters status; };

bool finite(vec3 v) {
    return !any(isnan(v)) && !any(isinf(v));
}
