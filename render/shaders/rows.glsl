// Rows of draws and materials. Included by every shader of surfaces.

struct Draw {
    vec4 linear[3];
    vec4 cofactor[3];
    uvec4 material;  // row of the material, mirrored
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

layout(std430, binding = 0) readonly buffer Draws { Draw draws[]; };
layout(std430, binding = 1) readonly buffer Materials { Material materials[]; };
