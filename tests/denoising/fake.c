// Stands for Open Image Denoise in tests without it: halves the picture, quarters it if it has guides, and leaves guides as they are.
// MAJOR is its version; with FAILS it fails.
#include <stdbool.h>
#include <stddef.h>
#include <string.h>

static struct {
    const float *color, *albedo, *normal;
    float *output;
    size_t values;
    bool hdr;
    bool clean_guides;
    int error;
} state;

void *oidnNewDevice(int type) { return type == 1 ? &state : NULL; }
void oidnSetDeviceInt(void *device, const char *name, int value) {}
void oidnSetDeviceBool(void *device, const char *name, bool value) {}
int oidnGetDeviceInt(void *device, const char *name) { return strcmp(name, "versionMajor") ? 1 : MAJOR; }
void oidnCommitDevice(void *device) {}
void oidnReleaseDevice(void *device) {}
void *oidnNewFilter(void *device, const char *type) {
    state.color = state.albedo = state.normal = NULL;
    state.hdr = state.clean_guides = false;
    return strcmp(type, "RT") ? NULL : &state;
}
void oidnCommitFilter(void *filter) {}
void oidnReleaseFilter(void *filter) {}

int oidnGetDeviceError(void *device, const char **message) {
    int error = state.error;
    state.error = 0;
    *message = error ? "not enough\nmemory" : NULL;
    return error;
}

void oidnSetSharedFilterImage(void *filter, const char *name, void *pixels, int format, size_t width, size_t height,
                              size_t offset, size_t pixel_stride, size_t row_stride) {
    state.values = 3 * width * height;
    if (!strcmp(name, "color")) state.color = pixels;
    if (!strcmp(name, "albedo")) state.albedo = pixels;
    if (!strcmp(name, "normal")) state.normal = pixels;
    if (!strcmp(name, "output")) state.output = pixels;
    if (format != 3 || offset || pixel_stride || row_stride) state.error = 2;
}

void oidnSetFilterBool(void *filter, const char *name, bool value) {
    if (!strcmp(name, "hdr")) state.hdr = value;
    if (!strcmp(name, "cleanAux")) state.clean_guides = value;
}

void oidnExecuteFilter(void *filter) {
    bool is_guide = !state.color && !state.albedo != !state.normal;
    bool is_guided = state.albedo && state.normal && state.clean_guides;
    if (FAILS || (!is_guide && !state.hdr)) {
        state.error = 4;
        return;
    }
    const float *input = state.color ? state.color : state.albedo ? state.albedo : state.normal;
    float divisor = is_guide ? 1 : is_guided ? 4 : 2;
    for (size_t i = 0; i < state.values; i++) state.output[i] = input[i] / divisor;
}
