// Starts of photon paths: `emission` writes them, `photons` reads them. Include after random.glsl and settings.glsl.

layout(push_constant) uniform PathsPush {
    uint iteration;
    uint block;             // see config::RenderConfig::block_of
    uint first_of_sequence; // paths of the block before this iteration, of its sequence
    uint first_path;        // of this batch
    uint path_count;
} push;

// Quadruples of random numbers that a path's start takes.
const uint START_NUMBERS = 2u;

// Of a path of the batch.
Random random_of_path(uint path) {
    return random_of_photon(push.first_path + path, push.iteration, push.block, push.first_of_sequence, settings.seed);
}

// Continues with the random numbers of another path, after its start.
void turn_to_path(inout Random random, uint path) {
    Random other = random_of_path(path);
    random.path = other.path;
    random.index = other.index;
    random.state = other.state;
    random.dimension = START_NUMBERS;
}
