// Rows of draws, which only vertices read: what pixels need of them comes from there, flat.

struct Draw {
    vec3 linear[3];
    vec3 cofactor[3];
    uint sides;     // 0 as wound, 1 where the draw mirrors, 2 where both sides take the same light
};

uniform sampler2D draw_rows;

const int ACROSS = 1024;  // rows beside each other
const int DRAW_TEXELS = 6;

vec4 draw_texel(int row, int texel) {
    return texelFetch(draw_rows, ivec2(row % ACROSS * DRAW_TEXELS + texel, row / ACROSS), 0);
}

Draw draw_row(int row) {
    vec4 first = draw_texel(row, 0), second = draw_texel(row, 1);
    return Draw(vec3[](first.xyz, second.xyz, draw_texel(row, 2).xyz),
                vec3[](draw_texel(row, 3).xyz, draw_texel(row, 4).xyz, draw_texel(row, 5).xyz),
                uint(second.w));
}
