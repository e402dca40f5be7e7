// Places a vertex relative to the camera: what is large was subtracted in float64 before it came here.
// #include rows.glsl
// #include material_row.glsl

uniform mat4 clip_from_relative;

in vec3 in_position;
in vec3 in_normal;
in vec2 in_st;
in vec2 in_st1;
in vec4 in_color;
in uint in_draw;
in vec3 in_offset;
#ifdef FACET
in vec3 in_plane;
in vec2 in_place;
#endif

// #include bar.glsl
#ifdef FADES
out float shown;                // share of a surface that is left where it is about to become a ribbon
#endif
#ifdef RIBBON
uniform vec3 to_sun;
out float width_times_depth;    // half the width [px m]
out float across_times_depth;   // distance from the axis [px m]
flat out vec2 across;           // direction across the bar on the image
flat out float one_share;       // how much of what is seen of the bar faces the first of two ways
out vec3 one_normal;
out vec3 other_normal;
#endif

invariant gl_Position;  // depth alone and shading, which are two programs, must agree to the last bit
out vec3 relative;
out vec3 normal;
out vec2 st;
out vec2 st1;
out vec2 albedo_place;
out vec2 roughness_place;
out vec2 normal_place;
out vec2 metallic_place;
#ifdef HAS_EMISSION
out vec2 emission_place;
#endif
out vec3 vertex_color;
flat out uint draw;
flat out uint sides;
#ifdef FACET
flat out vec3 plane;
flat out vec2 place_of_plane;
#endif

vec2 place(vec4 map[2]) {
    vec3 source = vec3(map[1].w > 0.5 ? in_st1 : in_st, 1.0);
    return vec2(dot(map[0].xyz, source), dot(map[1].xyz, source));
}

#ifdef BAR
vec3 turned(Draw row, vec3 way) {
    return vec3(dot(row.linear[0], way), dot(row.linear[1], way), dot(row.linear[2], way));
}
#endif

#ifdef RIBBON
// The strip that a bar covers and a pixel to either side; what is shaded is what of the bar faces the camera.
void lay_ribbon(Draw row) {
    vec3 axis = turned(row, in_axis), first = turned(row, in_first), second = turned(row, in_second);
    vec4 clip = clip_from_relative * vec4(relative, 1.0);
    float depth_along = (clip_from_relative * vec4(axis, 0.0)).w;
    if (clip.w < NEAREST && depth_along > 0.0) relative += axis * min((NEAREST - clip.w) / depth_along, 1.0);
    clip = clip_from_relative * vec4(relative, 1.0);
    across = across_bar(clip, axis * in_shape.z);
    bool is_round = in_shape.y > 0.5, is_flat = dot(second, second) < 1e-4 * dot(first, first);
    float wide = half_width(clip, across, first, second, is_round), reach = wide + 1.0;
    float radius = length(first);
    vec3 view = -normalize(relative), along = normalize(axis) * in_shape.z;
    vec3 aside = normalize(cross(along, view)), towards = cross(aside, along);
    vec3 one = normalize(first), other = normalize(cross(along, first));
    one_normal = one * (dot(one, view) < 0.0 ? -1.0 : 1.0);
    other_normal = other * (dot(other, view) < 0.0 ? -1.0 : 1.0);
    float one_width = abs(dot(across, shifted(clip, second))), other_width = abs(dot(across, shifted(clip, first)));
    one_share = is_flat ? 0.0 : one_width / max(one_width + other_width, 1e-9);
    if (is_round) {  // two points of Gauss's rule over the half that is seen
        one_normal = 0.8165 * towards + 0.57735 * aside;
        other_normal = 0.8165 * towards - 0.57735 * aside;
        one_share = 0.5;
    }
    float nearer = is_flat ? 0.01 : 1.5 * (radius + length(second));
    if (is_flat) {  // it stays in its plane, which something else may lie in too
        float lean = dot(across, shifted(clip, first));
        float longer = min(reach / max(abs(lean), 1e-6), 20.0);
        reach = abs(lean) * longer;
        gl_Position = clip_from_relative * vec4(relative + first * (lean < 0.0 ? -1.0 : 1.0) * in_shape.x * longer, 1.0);
    } else {
        gl_Position = clip;
        gl_Position.xy += across * in_shape.x * reach / half_size * clip.w;
    }
    gl_Position.z *= gl_Position.w / max(gl_Position.w - nearer - 2e-4 * gl_Position.w, 0.1);
    width_times_depth = wide * clip.w;
    across_times_depth = in_shape.x * reach * clip.w;
    relative += to_sun * (radius + 0.1);
}
#endif

void main() {
    Draw row = draw_row(int(in_draw));
    relative = vec3(dot(row.linear[0], in_position), dot(row.linear[1], in_position), dot(row.linear[2], in_position))
             + in_offset;
    normal = vec3(dot(row.cofactor[0], in_normal), dot(row.cofactor[1], in_normal), dot(row.cofactor[2], in_normal));
    st = in_st;
    st1 = in_st1;
    albedo_place = place(albedo_map);
    roughness_place = place(roughness_map);
    normal_place = place(normal_map);
    metallic_place = place(metallic_map);
#ifdef HAS_EMISSION
    emission_place = place(emission_map);
#endif
    vertex_color = in_color.rgb;
    draw = in_draw;
    sides = row.sides;
#ifdef FACET
    plane = in_plane;
    place_of_plane = in_place;
#endif
#ifdef RIBBON
    lay_ribbon(row);
#else
    gl_Position = clip_from_relative * vec4(relative, 1.0);
#endif
#ifdef FADES
    vec4 clip = clip_from_relative * vec4(relative, 1.0);
    shown = 1.0;
    if (in_shape.y >= 0.0 && clip.w > NEAREST) {
        vec2 across = across_bar(clip, turned(row, in_axis));
        float wide = 2.0 * half_width(clip, across, turned(row, in_first), turned(row, in_second), in_shape.y > 0.5);
        shown = smoothstep(FADING, WIDEST, wide);
    }
#endif
}
