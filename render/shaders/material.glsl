// Materials: rows, look-ups, detail. Included by the surface and the shadow shader.

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
    vec4 frequencies;  // detail: tiles per metre of each octave, layer
    vec4 amplitudes;   // detail: contrast of each octave, macro layer
    vec4 options;      // opacity threshold, takes the vertex colour
};

layout(std430, binding = 0) readonly buffer Draws { Draw draws[]; };
layout(std430, binding = 1) readonly buffer Materials { Material materials[]; };

#ifdef HAS_ALBEDO
uniform sampler2DArray albedo_array;
#endif
#ifdef HAS_ROUGHNESS
uniform sampler2DArray roughness_array;
#endif
#ifdef HAS_NORMAL
uniform sampler2DArray normal_array;
#endif
#ifdef HAS_DETAIL
uniform sampler2DArray detail_array;
#endif
#ifdef HAS_MACRO
uniform sampler2DArray macro_array;
#endif

in vec2 st;
in vec2 st1;
in vec3 vertex_color;
flat in uint draw;

const float SHARPER = -0.5;  // mip bias: without anisotropy the default blurs every slanted surface

vec3 place(vec4 map[2]) {
    vec3 source = vec3(map[1].w > 0.5 ? st1 : st, 1.0);
    return vec3(dot(map[0].xyz, source), dot(map[1].xyz, source), map[0].w);
}

#ifdef HAS_ALBEDO
vec4 look_up_albedo(Material material) {
    vec4 texel = texture(albedo_array, place(material.albedo), SHARPER);
    return vec4(texel.rgb * texel.rgb, texel.a);
}
#endif

float detail_factor(Material material) {
    float factor = 1.0;
#ifdef HAS_DETAIL
    for (int octave = 0; octave < 3; octave++) {
        float grey = texture(detail_array, vec3(st * material.frequencies[octave], material.frequencies.w), SHARPER).r;
        factor *= 1.0 + material.amplitudes[octave] * (2.0 * grey - 1.0);
    }
#endif
    return factor;
}

vec3 macro_factor(Material material) {
#ifdef HAS_MACRO
    return 2.0 * texture(macro_array, vec3(st1, material.amplitudes.w)).rgb;
#else
    return vec3(1.0);
#endif
}
