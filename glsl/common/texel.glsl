// Texel buffers: four words per fetch, on some drivers several times faster than four loads from a storage buffer. (Macros,
// because reflection does not see a texel buffer that is passed to a function.)
#define TEXEL(buffer, i) uintBitsToFloat(texelFetch(buffer, int(i)))
#define TEXEL_BITS(buffer, i) texelFetch(buffer, int(i))
