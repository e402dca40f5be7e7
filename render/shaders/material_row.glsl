// What the draws at hand look like: one row of `ROW` in materials.py. Bound once for all draws of a material: read anew at
// each vertex from a texture it took a third of a vertex's time.

layout(std140, binding = 0) uniform MaterialRow {
    vec4 base;              // linear colour, roughness
    vec4 emissive;          // linear colour, or what its texture is multiplied by; metallic
    vec4 albedo_map[2];     // rows of the affine map of (s, t, 1); then layer, uv set
    vec4 roughness_map[2];
    vec4 normal_map[2];
    vec4 metallic_map[2];
    vec4 frequencies;       // detail: tiles per metre of each octave, layer
    vec4 amplitudes;        // detail: contrast of each octave, macro layer
    vec4 options;           // opacity threshold, takes the vertex colour, opacity
    vec4 emission_map[2];
    vec4 specular;          // linear colour of the shine straight on
};
