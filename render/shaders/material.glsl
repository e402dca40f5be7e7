// Look-ups and detail of materials. Included by the surface, id and shadow shaders.

// #include material_row.glsl

#ifdef HAS_ALBEDO
uniform sampler2DArray albedo_array;
#endif
#ifdef HAS_ROUGHNESS
uniform sampler2DArray roughness_array;
#endif
#ifdef HAS_NORMAL
uniform sampler2DArray normal_array;
#endif
#ifdef HAS_METALLIC
uniform sampler2DArray metallic_array;
#endif
#ifdef HAS_EMISSION
uniform sampler2DArray emission_array;
in vec2 emission_place;
#endif
#ifdef HAS_DETAIL
uniform sampler2DArray detail_array;
#endif
#ifdef HAS_MACRO
uniform sampler2DArray macro_array;
#endif

in vec2 st;
in vec2 st1;
in vec2 albedo_place;
in vec2 roughness_place;
in vec2 normal_place;
in vec2 metallic_place;
in vec3 vertex_color;
flat in uint draw;
flat in uint sides;     // of the draw, as in rows.glsl

// Without anisotropy the default mip level blurs every slanted surface; what comes out too sharp, the lens blurs.
const float SHARPER = -1.0;

#ifdef SAMPLES  // rows of samples lie closer than pixels do: the size of a pixel chooses the level
vec4 look_up(sampler2DArray images, vec3 place) {
    vec2 across = dFdx(place.xy), down = float(SAMPLES) * dFdy(place.xy) + float(SHEAR) * across;
    return textureGrad(images, place, across * exp2(SHARPER), down * exp2(SHARPER));
}
#else
#define look_up(images, place) texture(images, place, SHARPER)
#endif

#ifdef HAS_ALBEDO
vec4 look_up_albedo() {
    vec4 texel = look_up(albedo_array, vec3(albedo_place, albedo_map[0].w));
    return vec4(texel.rgb * texel.rgb, texel.a);
}
#endif

// The macro texture has texels of centimeters. What is smaller about its stains, the detail says: dirt collects in its dark
// pores, and their edges follow its grain. Over some texels the mean is that of the texture. As in bake_stains.py.
const float WHOLE = 0.5;        // deviation of a stain that covers everything [1]
const float RAGGED = 6.0;       // change of a faint stain over the deviation of the detail [1]
const float BENT = 1.0 / 1300.0;    // shift of its edges over that of an octave, in widths of the texture [1]
const vec2 SHIFTS[3] = vec2[](vec2(0.0), vec2(BENT, BENT), vec2(BENT, -BENT));

float detail_factor(out vec2 shift) {
    float factor = 1.0;
    shift = vec2(0.0);
#ifdef HAS_DETAIL
    for (int octave = 0; octave < 3; octave++) {
        float grey = look_up(detail_array, vec3(st * frequencies[octave], frequencies.w)).r;
        float part = amplitudes[octave] * (2.0 * grey - 1.0);
        factor *= 1.0 + part;
        shift += part * SHIFTS[octave];
    }
#endif
    return factor;
}

vec3 macro_factor(float detail, vec2 shift) {
#ifdef HAS_MACRO
    vec3 stain = 2.0 * texture(macro_array, vec3(st1 + shift, amplitudes.w)).rgb - 1.0;
    vec3 size = abs(stain);
    float share = clamp(max(size.r, max(size.g, size.b)) / WHOLE, 1e-3, 1.0);
    float ragged = dot(stain, vec3(1.0)) < 0.0 ? RAGGED * (1.0 - share) : 0.0;
    return 1.0 + stain * clamp(1.0 + ragged * (1.0 - detail), 0.0, 1.0 / share);
#else
    return vec3(1.0);
#endif
}
