// Texel buffers: four words a fetch, which some drivers do several times faster than four loads from a storage buffer.
// (Macros, since a texel buffer that is passed to a function escapes the reflection.)
#define TEXEL(buffer, i) uintBitsToFloat(texelFetch(buffer, int(i)))
#define TEXEL_BITS(buffer, i) texelFetch(buffer, int(i))
