// Which pixel of the photograph a texel of the edges' samples lies in, as in edge_samples.py: row j of SAMPLES rows of a
// pixel lies j / SAMPLES of a pixel lower, and the whole image is sheared by SHEAR pixels for each row of pixels.

ivec2 pixel_of(ivec2 texel) {
    int row = texel.y / SAMPLES, twice = SAMPLES * (2 * texel.x + 1) - SHEAR * (2 * texel.y + 1);
    return ivec2(twice >= 0 ? twice / (2 * SAMPLES) : -1, row);
}

// The texel of a pixel in one of its rows.
ivec2 texel_of(ivec2 pixel, int sample_row) {
    int row = pixel.y * SAMPLES + sample_row, twice = 2 * SAMPLES * pixel.x + SHEAR * (2 * row + 1) - SAMPLES;
    return ivec2((twice + 2 * SAMPLES - 1) / (2 * SAMPLES), row);
}
