#version 460
// Counts the iterations that the driver allows a loop. The mixed bits keep compilers from replacing the loop by its result.

layout(local_size_x = 1) in;

layout(push_constant) uniform CountPush {
    uint count;
} push;

layout(std430) writeonly buffer ScanTotal { uint scan_total; };

void main() {
    uint done = 0u;
    uint mixed = 1u;
    while (mixed != 0u && done < push.count) {
        // A full-period generator over odd numbers: never 0.
        mixed = mixed * 1664525u | 1u;
        done += 1u;
    }
    scan_total = done;
}
