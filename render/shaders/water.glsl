// Water: ripples that repeat nowhere, and what it mirrors. Included by the surface shader.

uniform sampler2D mirrored_image;   // square root of radiance, as the photograph
uniform mat4 image_from_relative;
uniform float mirror_level;         // height of the water that the image was drawn for, counted as `eye` [m]

const float WATER_STRAIGHT = 0.02;  // share of light that water mirrors straight on
const float AWAY = 14.0;            // distance at which ripples shift what is mirrored as they should [m]
const float FOCAL = 850.0;          // [px] about that of a survey: finer ripples than a pixel blur

uint scrambled(uint x) {
    x ^= x >> 16;
    x *= 0x7feb352du;
    x ^= x >> 15;
    x *= 0x846ca68bu;
    return x ^ (x >> 16);
}

// Smooth noise and its slope: (value 0 to 1, d/dx, d/dy).
vec3 noise(vec2 place) {
    vec2 cell = floor(place), part = place - cell;
    ivec2 at = ivec2(cell);
    uvec4 x = uvec4(at.x, at.x + 1, at.x, at.x + 1), y = uvec4(at.y, at.y, at.y + 1, at.y + 1);
    vec4 value;
    for (int corner = 0; corner < 4; corner++)
        value[corner] = float(scrambled(x[corner] * 0x9e3779b1u + y[corner] * 0x85ebca77u) >> 8) / 16777216.0;
    vec2 rise = part * part * part * (part * (6.0 * part - 15.0) + 10.0);
    vec2 slope = 30.0 * part * part * (part * (part - 2.0) + 1.0);
    float a = value.x, b = value.y - value.x, c = value.z - value.x, d = value.x - value.y - value.z + value.w;
    return vec3(a + b * rise.x + c * rise.y + d * rise.x * rise.y, slope * (vec2(b, c) + d * rise.yx));
}

float calm;  // 0 where the wind ripples the water, 1 where it does not

vec3 rippled(vec3 scene, float away) {
    vec2 place = scene.xy;
    float gusts = noise(place / 23.0).x * 0.6 + noise(place.yx / 7.0).x * 0.4;
    calm = smoothstep(0.35, 0.65, gusts);
    vec2 slope = vec2(0.0);
    vec2 way = vec2(1.0, 0.0);
    float wave = 1.9;
    for (int octave = 0; octave < 3; octave++) {
        vec2 turned = vec2(dot(way, place), dot(vec2(-way.y, way.x), place)) * vec2(1.0, 0.6);
        vec2 here = noise(turned / wave).yz * vec2(1.0, 0.6);
        float left = clamp(1.5 - 3.0 * away / (FOCAL * wave), 0.0, 1.0);
        slope += left * (way * here.x + vec2(-way.y, way.x) * here.y);
        way = vec2(0.6 * way.x - 0.8 * way.y, 0.8 * way.x + 0.6 * way.y);
        wave *= 0.43;
    }
    return normalize(vec3(-slope * mix(0.030, 0.010, calm), 1.0));
}

vec3 body_color(vec3 albedo, vec3 scene) {
    return albedo * (0.75 + 0.3 * calm);
}

// What is seen in the water: the image where it was drawn for this water, else the sky.
vec3 mirrored_light(vec3 scene, vec3 view, vec3 n, float away, vec3 sky) {
    vec3 open = max(open_sky[0] + open_sky[3], 1e-4);
    vec3 bounce = reflect(-view, n);
    bounce.z = abs(bounce.z);
    if (abs(scene.z - mirror_level) > 0.75) return sky_towards(bounce, 0.1) * min(sky / open, 1.0);
    vec3 sum = vec3(0.0);
    float spread = mix(0.035, 0.012, calm) * (0.4 + min(away / 60.0, 1.2));  // of slopes too fine to draw
    for (int tap = -1; tap <= 1; tap++) {
        vec3 tilted = normalize(n + vec3(view.xy * (float(tap) * spread), 0.0));
        vec3 way = reflect(-view, tilted);
        vec3 seen = relative + vec3(way.xy, -abs(way.z)) * AWAY;
        vec4 clip = image_from_relative * vec4(seen, 1.0);
        vec3 code = textureLod(mirrored_image, clip.xy / clip.w * 0.5 + 0.5, 0.6).rgb;
        sum += code * code * (tap == 0 ? 0.5 : 0.25);
    }
    return sum / code_scale;
}
