// Rows of draws and materials, which only vertices read: what pixels need of them comes from there, flat.

struct Draw {
    vec3 linear[3];
    vec3 cofactor[3];
    int material;
    bool mirrored;
};
struct Material {
    vec4 base;       // linear colour, roughness
    vec4 emissive;   // linear colour, metallic
    vec4 albedo[2];  // rows of the affine map of (s, t, 1); then layer, uv set
    vec4 roughness[2];
    vec4 normal[2];
    vec4 metallic[2];
    vec4 frequencies;  // detail: tiles per metre of each octave, layer
    vec4 amplitudes;   // detail: contrast of each octave, macro layer
    vec4 options;      // opacity threshold, takes the vertex colour
};

uniform sampler2D draw_rows;
uniform sampler2D material_rows;

const int ACROSS = 1024;  // rows beside each other
const int DRAW_TEXELS = 6, MATERIAL_TEXELS = 13;

vec4 draw_texel(int row, int texel) {
    return texelFetch(draw_rows, ivec2(row % ACROSS * DRAW_TEXELS + texel, row / ACROSS), 0);
}

vec4 material_texel(int row, int texel) {
    return texelFetch(material_rows, ivec2(row % ACROSS * MATERIAL_TEXELS + texel, row / ACROSS), 0);
}

Draw draw_row(int row) {
    vec4 first = draw_texel(row, 0), second = draw_texel(row, 1);
    return Draw(vec3[](first.xyz, second.xyz, draw_texel(row, 2).xyz),
                vec3[](draw_texel(row, 3).xyz, draw_texel(row, 4).xyz, draw_texel(row, 5).xyz),
                int(first.w), second.w > 0.5);
}

Material material_row(int row) {
    vec4 maps[8];
    for (int texel = 0; texel < 8; texel++) maps[texel] = material_texel(row, 2 + texel);
    return Material(material_texel(row, 0), material_texel(row, 1), vec4[](maps[0], maps[1]), vec4[](maps[2], maps[3]),
                    vec4[](maps[4], maps[5]), vec4[](maps[6], maps[7]), material_texel(row, 10),
                    material_texel(row, 11), material_texel(row, 12));
}
