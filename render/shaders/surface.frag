// Shades a surface. Features (HAS_…, CUT_OUT, BLEND, ROUGHNESS_IN_ALBEDO, SPECULAR, MATT, MIRROR, VOLUME, SUN, LOCAL_LIGHTS n,
// LOCAL_PANELS, NORMALS, GREY_CARD) are put in front when it is compiled.
// #include material.glsl

uniform vec3 eye;               // camera centre, counted from the scene's anchor [m]
uniform vec3 to_sun;
uniform vec3 sun_irradiance;
uniform vec3 open_sky[4];
uniform vec3 haze[3];           // of far air by the cosine of the angle to the sun: constant, slope, glow
uniform vec3 haze_density;      // [1/m] in powers of two
uniform float code_scale;       // 1 / brightest radiance that the target can hold

uniform sampler3D volume_x;     // irradiance along the axis, below it against it; a share of the mean in each alpha
uniform sampler3D volume_y;
uniform sampler3D volume_z;
uniform vec3 volume_lower;
uniform vec3 volume_scale;      // 1 / size of the texture [1/m]
uniform float volume_cell;      // [m]
uniform float volume_ahead;     // distance from the surface at which it is read [m]

#ifdef LOCAL_LIGHTS
uniform vec4 local_places[LOCAL_LIGHTS];      // centre, counted from the scene's anchor; radius [m]
uniform vec3 local_intensities[LOCAL_LIGHTS]; // radiant intensity [m2]
#ifdef LOCAL_PANELS
uniform vec3 local_sides[2 * LOCAL_LIGHTS];   // from a panel's centre to two of its edges [m]; zero for a ball
#endif
#endif

uniform sampler2D panorama;
uniform mat3 dome_from_world;

in vec3 relative;
in vec3 normal;
#ifdef ABOVE
uniform float waterline;        // height over the camera below which nothing is mirrored [m]
#endif

#ifdef BAR
in float width_times_depth;
flat in vec4 fades;
#endif
#ifdef VEILED
uniform sampler2D ribbons_away; // [m]
#endif
#ifdef RIBBON
in float across_times_depth;
flat in vec2 across;
flat in float one_share;
flat in float one_side;
in vec3 one_normal;
in vec3 other_normal;

const float TRACE = 1e-3;       // share that is too small to be seen [1]: it marks pixels that need samples
const float SURELY_SEEN = 1.2;  // [px] a bar so wide lies on the middle of a pixel somewhere along every row or column
layout(location = 0) out vec4 out_coverage;     // linear light over the brightest one, times what is covered; that
layout(location = 1) out float out_away;    // [m]
#else
layout(location = 0) out vec4 out_color;
layout(location = 1) out uint out_draw;
layout(location = 2) out float out_depth;
#ifdef NORMALS
layout(location = 3) out vec4 out_normal;
#endif
#ifdef TRIANGLES
layout(location = 3) out uint out_triangle;
#endif
#endif

// A card stands for leaves at all angles in front of each other. Its normal is that of the crown around it, so the angle
// at which it is seen says nothing about how grazing they are seen: they have no bright rim, which would be sky of no
// color on the green, and in a shadow brighter than the lawn. Most of the sky that a leaf would mirror, others hide.
#if defined(CUT_OUT) && !defined(BLEND)
#define LEAVES
#endif
const float LEAF_SHINE = 0.4;   // share of the sky that is not hidden [1]
const vec3 LEAF_THROUGH = vec3(0.7, 0.8, 0.4);  // light let through over light scattered back [1]: it lost more blue

#if defined(SOFT) && !defined(MATT)
#define SHINES
#endif

const float PI = 3.14159265;
const float GLOW = 0.08;        // as in daylight.py

// #include sun_shadow.glsl
#ifdef CREASES
// #include crease.glsl
#endif

vec3 sky_irradiance(vec3 scene, vec3 n) {
    vec3 open = open_sky[0] + n.x * open_sky[1] + n.y * open_sky[2] + n.z * open_sky[3];
#ifdef VOLUME
    vec3 place = (scene + n * volume_ahead - volume_lower) * volume_scale;
    vec3 layer = 0.5 * (place.z + vec3(lessThan(n, vec3(0.0))));
    vec4 along_x = texture(volume_x, vec3(place.xy, layer.x));
    vec4 along_y = texture(volume_y, vec3(place.xy, layer.y));
    vec4 along_z = texture(volume_z, vec3(place.xy, layer.z));
    vec3 weight = abs(n);
    vec3 held = weight.x * along_x.rgb + weight.y * along_y.rgb + weight.z * along_z.rgb
                + (1.0 - weight.x - weight.y - weight.z) * vec3(along_x.a, along_y.a, along_z.a);
    vec3 rim = min(place, 1.0 - place) / (volume_cell * volume_scale) - 0.5;
    return max(mix(open, held, clamp(min(rim.x, min(rim.y, rim.z)), 0.0, 1.0)), 0.0);
#else
    return max(open, 0.0) * (0.72 + 0.28 * n.z);
#endif
}

vec3 bumped(vec3 n) {
#ifdef HAS_NORMAL
    vec3 bump = look_up(normal_array, vec3(normal_place, normal_map[0].w)).xyz * 2.0 - 1.0;
    vec3 dx = dFdx(relative), dy = dFdy(relative);
    vec2 sx = dFdx(normal_place), sy = dFdy(normal_place);
#ifdef SAMPLES
    dy *= float(SAMPLES);
    sy *= float(SAMPLES);
#endif
    float turn = sx.x * sy.y - sy.x * sx.y;
    vec3 along = (dx * sy.y - dy * sx.y) * sign(turn);
    along -= n * dot(n, along);
    vec3 across = (dy * sx.x - dx * sy.x) * sign(turn);
    across -= n * dot(n, across);
    float length_along = dot(along, along), length_across = dot(across, across);
    if (length_along < 1e-20 || length_across < 1e-20) return n;
    return normalize(along * inversesqrt(length_along) * bump.x + across * inversesqrt(length_across) * bump.y
                     + n * max(bump.z, 0.05));
#else
    return n;
#endif
}

vec3 sky_towards(vec3 direction, float roughness) {
    vec3 d = dome_from_world * direction;
    vec2 place = vec2(0.5 - atan(d.x, d.z) / (2.0 * PI), acos(clamp(d.y, -1.0, 1.0)) / PI);
    return textureLod(panorama, place, roughness * 6.0).rgb;
}

// Source: Walter et al., Microfacet models for refraction, EGSR 2007 (GGX); Schlick 1994 (Fresnel);
// Karis, Real shading in Unreal Engine 4, SIGGRAPH 2013 course (visibility and roughness squared).
float highlight(float ndl, float ndv, float ndh, float roughness) {
    float a2 = roughness * roughness;
    a2 *= a2;
    float k = (roughness + 1.0) * (roughness + 1.0) / 8.0;
    float spread = ndh * ndh * (a2 - 1.0) + 1.0;
    return a2 / (PI * spread * spread) / (4.0 * (ndl * (1.0 - k) + k) * (ndv * (1.0 - k) + k));
}

float fifth(float x) {
    float square = x * x;
    return square * square * x;
}

#ifdef LOCAL_LIGHTS
// Cosine law of a ball of light, exact where the horizon of the surface cuts it too; `size` is (radius / distance)^2.
// Source: Lagarde and de Rousiers, Moving Frostbite to physically based rendering, SIGGRAPH 2014 course, section 4.7.
float ball_cosine(float cosine, float size) {
    if (cosine * cosine > size) return max(cosine, 0.0);
    float sine = sqrt(1.0 - cosine * cosine);
    float x = sqrt(1.0 / size - 1.0);
    float y = clamp(-x * cosine / sine, -1.0, 1.0);
    float root = sine * sqrt(1.0 - y * y);
    return max((cosine * acos(y) - x * root) * size + atan(root / x), 0.0) / (PI * size);
}
#endif

#ifdef LOCAL_PANELS
// What an edge of a polygon of light adds to the irradiance, for corners as seen from the surface.
// Source: Lambert 1760; Baum, Rushmeier and Winget, Improving radiosity solutions through the use of analytically
// determined form-factors, SIGGRAPH 1989.
vec3 edge_light(vec3 from, vec3 to) {
    vec3 turn = cross(from, to);
    float sine = length(turn);
    return sine > 1e-12 ? turn * (atan(sine, dot(from, to)) / sine) : vec3(0.0);
}

// Direction in which a panel's light arrives, times the share of the half sphere that it fills.
vec3 panel_light(vec3 reach, vec3 across, vec3 up) {
    vec3 a = normalize(reach - across - up), b = normalize(reach + across - up);
    vec3 c = normalize(reach + across + up), d = normalize(reach - across + up);
    return (edge_light(a, b) + edge_light(b, c) + edge_light(c, d) + edge_light(d, a)) / (2.0 * PI);
}
#endif

#ifdef WATER
// #include water.glsl
#endif

vec3 shade(vec3 albedo, vec3 face, float roughness) {
    vec3 scene = relative + eye;
    float away = length(relative);
    vec3 view = -relative / away;
#ifdef WATER
    vec3 n = rippled(scene, away);
#else
    vec3 n = bumped(face);
#endif
    float ndl = dot(n, to_sun);
    float lit = 0.0;
    vec3 through = vec3(0.0);
#ifdef SUN
    float seen = sun_visibility();  // not in the branch: it needs the neighbouring pixels
    if (dot(face, to_sun) > 0.0 && ndl > 0.0) lit = ndl * seen;
#ifdef LEAVES
    through = LEAF_THROUGH * (max(-ndl, 0.0) * seen);
#endif
#endif
#ifdef WATER
    vec3 sky = sky_irradiance(scene, face);
#else
    vec3 sky = sky_irradiance(scene, n);
#endif
    float metallic = emissive.a;
#ifdef HAS_METALLIC
    metallic = look_up(metallic_array, vec3(metallic_place, metallic_map[0].w)).r;
#endif
#ifdef GREY_CARD
    metallic = 0.0;
#endif
#ifdef WATER
    // Light enters beside a shadow and is scattered below it: shadows on water are faint.
    float entering = max(face.z * to_sun.z, 0.0);
    vec3 light = body_color(albedo, scene) / PI * (sun_irradiance * mix(entering, lit, 0.5) + sky);
#else
    vec3 light = albedo * (1.0 - metallic) / PI * (sun_irradiance * (lit + through) + sky);
#endif
#ifdef SHINES
#ifdef HAS_ROUGHNESS
    roughness = look_up(roughness_array, vec3(roughness_place, roughness_map[0].w)).r;
#endif
    roughness = clamp(roughness, 0.05, 1.0);
    vec3 f0 = mix(vec3(0.04), albedo, metallic), f90 = vec3(1.0);
#ifdef SPECULAR
    f0 = specular.rgb;
    f90 = min(f0 * 50.0, 1.0);  // Lagarde and de Rousiers: no matter mirrors less than 2 % straight on
#endif
    vec3 middle = normalize(view + to_sun);
    float ndv = max(dot(n, view), 0.02);
    float grazing = fifth(1.0 - max(dot(middle, view), 0.0));
    light += sun_irradiance * lit * (f0 + (f90 - f0) * grazing) * highlight(max(ndl, 0.0), ndv, max(dot(n, middle), 0.0), roughness);
    float rim = fifth(1.0 - ndv) * (1.0 - roughness) * (1.0 - roughness);
#ifdef LEAVES
    f0 *= LEAF_SHINE;
    rim = 0.0;
#endif
#ifdef WATER
    light += (WATER_STRAIGHT + (1.0 - WATER_STRAIGHT) * fifth(1.0 - ndv)) * mirrored_light(scene, view, n, away, sky);
#elif defined(MIRROR)
    vec3 open = max(open_sky[0] + n.x * open_sky[1] + n.y * open_sky[2] + n.z * open_sky[3], 1e-4);
    vec3 bounce = reflect(-view, n);
    if (n.z > 0.2) bounce.z = abs(bounce.z);  // rippled water never mirrors what is below it
    light += (f0 + (f90 - f0) * rim) * sky_towards(bounce, roughness) * min(sky / open, 1.0);
#else
    light += (f0 + (f90 - f0) * rim) * sky / PI;
#endif
#endif
#ifdef LOCAL_LIGHTS
    for (int number = 0; number < LOCAL_LIGHTS; number++) {
        vec3 reach = local_places[number].xyz - scene;
        float square = max(dot(reach, reach), 1e-6);
        vec3 towards = reach * inversesqrt(square);
        float size = min(local_places[number].w * local_places[number].w / square, 0.999);
        vec3 strength = local_intensities[number] / square;
#ifdef LOCAL_PANELS
        vec3 across = local_sides[2 * number], up = local_sides[2 * number + 1];
        vec3 shines = cross(up, across);
        if (dot(shines, shines) > 0.0) {
            if (dot(shines, reach) >= 0.0) continue;  // behind it
            vec3 arriving = panel_light(reach, across, up);
            size = clamp(length(arriving), 1e-12, 0.999);
            towards = arriving / size;
            strength = local_intensities[number] / (4.0 * length(shines)) * PI * size;
        }
#endif
        float cosine = clamp(dot(n, towards), -0.9999, 0.9999);
        if (dot(face, towards) < -sqrt(size)) continue;
        vec3 received = strength * ball_cosine(cosine, size);
        light += albedo * (1.0 - metallic) / PI * received;
#ifndef SOFT
        light += albedo * metallic / PI * received;  // no shine is drawn: a metal scatters all that it reflects
#endif
#ifdef SHINES
        // Karis (as above): a ball widens the highlight, which keeps its energy.
        float wide = min(roughness * roughness + 0.5 * sqrt(size), 1.0);
        vec3 between = normalize(view + towards);
        light += received * (f0 + (f90 - f0) * fifth(1.0 - max(dot(between, view), 0.0)))
                 * highlight(max(cosine, 0.0), ndv, max(dot(n, between), 0.0), sqrt(wide))
                 * pow(roughness * roughness / wide, 2.0);
#endif
    }
#endif
#ifndef GREY_CARD
#ifdef HAS_EMISSION
    vec3 glow = look_up(emission_array, vec3(emission_place, emission_map[0].w)).rgb;
    light += glow * glow * emissive.rgb;
#else
    light += emissive.rgb;
#endif
#endif
    float sunward = -dot(view, to_sun);
    vec3 far = haze[0] + haze[1] * sunward + haze[2] * (GLOW / (1.0 + GLOW - sunward));
    return mix(far, light, exp2(-away * haze_density));
}

#ifdef RIBBON
// Share of a pixel that lies on one side of a line at some distance from its middle [px]: exact for a square.
float beside(float away) {
    vec2 slope = abs(across);
    float low = max(min(slope.x, slope.y), 1e-4), high = max(slope.x, slope.y);
    float corner = max(0.5 * (low + high) - abs(away), 0.0);
    float inside = abs(away) <= 0.5 * (high - low) ? 0.5 - abs(away) / high : corner * corner / (2.0 * low * high);
    return away > 0.0 ? 1.0 - inside : inside;
}
#endif

void main() {
#ifdef STEADY
    if (!(gl_FragCoord.w > 0.0 && gl_FragCoord.w < 3e38)) discard;  // a triangle seen edge-on may have no depth
#endif
#ifdef ABOVE
    if (relative.z < waterline) discard;
#endif
    vec3 albedo = base.rgb;
    float roughness = base.a;
#ifdef WATER
#ifdef HAS_ALBEDO
    albedo = textureLod(albedo_array, vec3(albedo_place, albedo_map[0].w), 9.0).rgb;  // its mean: no tile shows
    albedo *= albedo;
#ifdef ROUGHNESS_IN_ALBEDO
    roughness = look_up_albedo().a;  // where it lies is no reason for water to shine otherwise
#endif
#endif
#elif defined(HAS_ALBEDO)
    vec4 texel = look_up_albedo();
    albedo = texel.rgb;
#ifdef ROUGHNESS_IN_ALBEDO
    roughness = texel.a;
#endif
#if defined(CUT_OUT) && !defined(BLEND)
    if (texel.a < options.x) discard;
#endif
#endif
    if (options.y > 0.5) albedo = vertex_color;
#ifdef WATER
    albedo *= macro_factor(1.0, vec2(0.0));  // the bed of shallow water
#else
    vec2 shift;
    float detail = detail_factor(shift);
    albedo = min(albedo * detail * macro_factor(detail, shift), vec3(0.95));
#endif
#ifdef GREY_CARD
    albedo = vec3(0.18);
    roughness = 1.0;
#endif
#ifdef RIBBON
    float away = across_times_depth * gl_FragCoord.w, wide = width_times_depth * gl_FragCoord.w;
    float low = beside(away + wide), high = beside(away - wide), covered = low - high;
    float cover = covered * (1.0 - smoothstep(fades.z, fades.y, 2.0 * wide));
#ifdef SAMPLED
    if (covered < 1e-3 || 2.0 * wide > SURELY_SEEN) discard;
    cover = max(cover, TRACE);
#endif
    if (cover < TRACE) discard;
    float share = one_share;
    if (one_side != 0.0) {
        float upper = beside(away - one_side * wide * (1.0 - 2.0 * one_share));
        share = clamp((one_side > 0.0 ? upper - high : low - upper) / covered, 0.0, 1.0);
    }
    vec3 light = mix(shade(albedo, normalize(other_normal), roughness), shade(albedo, normalize(one_normal), roughness), share);
    out_coverage = vec4(min(light * code_scale, 1.0), 1.0) * cover;
    out_away = 1.0 / gl_FragCoord.w;
#else
    vec3 face = normalize(normal + vec3(0.0, 0.0, 1e-12));  // a mesh without area has no normal
    if (sides != 2u && gl_FrontFacing == (sides != 0u)) face = -face;
#ifdef BLEND
    float held = options.z;  // of the light behind
#ifdef CUT_OUT
    held = texel.a;
#endif
    out_color = vec4(clamp(shade(albedo, face, roughness) * code_scale, 0.0, 1.0), held);
#ifdef VEILED  // it holds back light of the ribbons behind it, and covers as much of the photograph as they do
    if (1.0 / gl_FragCoord.w > texelFetch(ribbons_away, ivec2(gl_FragCoord.xy), 0).r) discard;
    out_color.rgb *= held;
#endif
#else
    vec3 light = clamp(shade(albedo, face, roughness) * code_scale, 0.0, 1.0);
#ifdef SAMPLES
    out_color = vec4(light, 1.0);
#else
    out_color = vec4(sqrt(light), 1.0);
#endif
#endif
#ifdef FADES
    float shown = smoothstep(fades.x, fades.w, 2.0 * width_times_depth * gl_FragCoord.w);
    out_color.a = shown;
#ifdef PANES  // what is not shown must not hide them
    if (shown <= 0.0) discard;
#endif
#endif
#if defined(CREASES) && !defined(CUT_OUT)
    out_draw = creased(draw + 1u, face);
#else
    out_draw = draw + 1u;
#endif
    out_depth = 1.0 / gl_FragCoord.w;
#ifdef NORMALS
    out_normal = vec4(face, 1.0);
#endif
#ifdef TRIANGLES
    out_triangle = uint(gl_PrimitiveID);
#endif
#endif
}
