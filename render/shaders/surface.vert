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
#ifdef BAR
out float width_times_depth;    // half the width [px m]
flat out vec4 fades;            // [px] as in bar.glsl
#endif
#ifdef RIBBON
uniform vec3 to_sun;
out float across_times_depth;   // distance from the axis [px m]
flat out vec2 across;           // direction across the bar on the image
flat out float one_share;       // how much of what is seen of the bar faces the first of two ways
flat out float one_side;        // where across it that lies: 1, -1, or 0 for all of it
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

// A place on a bar in front of the camera: this end of a segment, or some way to the other one.
vec3 in_front(vec3 here, vec3 axis) {
    float away = (clip_from_relative * vec4(here, 1.0)).w, along = (clip_from_relative * vec4(axis, 0.0)).w;
    return away < NEAREST && along > 0.0 ? here + axis * min((NEAREST - away) / along, 1.0) : here;
}
#endif

#ifdef RIBBON
// 1 / depth of what lies nearer to the camera than a place on a bar [1/m], from 1 / its depth.
float forward(float inverse, float nearer) {
    return 1.0 / max((1.0 - 2e-4) / inverse - nearer, 0.1);
}

// The same at one end of a ribbon. Between its ends it changes evenly over the image, as 1 / depth does but `forward` does
// not: a ribbon from the camera's side to far away would lie before what hides it. So it is right at the far end and
// where the ribbon enters the image, or gets thin enough to be drawn: at `thin` [1/m].
float lifted(vec4 here, vec4 end, float nearer, float thin) {
    float near = 1.0 / here.w, far = 1.0 / max(end.w, 0.01);
    float first = forward(far, nearer), share = (thin - far) / (near - far);
    if (near <= 1.01 * far) return forward(near, nearer);
    for (int axis = 0; axis < 2; axis++) {
        float at = here[axis] * near, to = end[axis] * far;
        if (abs(at) > 1.0) share = min(share, (sign(at) - to) / (at - to));
    }
    share = clamp(share, 0.01, 1.0);
    return first + (forward(mix(far, near, share), nearer) - first) / share;
}

// The strip that a bar covers and a pixel to either side; what is shaded is what of the bar faces the camera.
void lay_ribbon(Draw row) {
    vec3 axis = turned(row, in_axis), first = turned(row, in_first), second = turned(row, in_second);
    relative = in_front(relative, axis);
    vec4 clip = clip_from_relative * vec4(relative, 1.0);
    across = across_bar(clip, axis * in_shape.z);
    bool is_round = in_shape.y > 0.5, is_edged = has_edges(first, second, is_round), is_flat = !is_round && !is_edged;
    fades = fading(is_edged);
    float wide = half_width(clip, across, first, second, is_round), reach = wide + 1.0;
    float radius = length(first);
    vec3 view = -normalize(relative), along = normalize(axis) * in_shape.z;
    vec3 aside = normalize(cross(along, view)), towards = cross(aside, along);
    vec3 one = normalize(first), other = normalize(cross(along, first));
    one_normal = one * (dot(one, view) < 0.0 ? -1.0 : 1.0);
    other_normal = other * (dot(other, view) < 0.0 ? -1.0 : 1.0);
    float one_width = abs(dot(across, shifted(clip, second))), other_width = abs(dot(across, shifted(clip, first)));
    one_share = is_flat ? 0.0 : one_width / max(one_width + other_width, 1e-9);
    one_side = is_edged ? (dot(across, shifted(clip, one_normal)) < 0.0 ? -1.0 : 1.0) : 0.0;
    if (is_round) {  // two points of Gauss's rule over the half that is seen
        one_normal = 0.8165 * towards + 0.57735 * aside;
        other_normal = 0.8165 * towards - 0.57735 * aside;
        one_share = 0.5;
    }
    float slant = max(length(cross(along, view)), 0.1);  // the surface of one seen nearly along lies the farther before it
    bool is_level = is_flat || is_embedded();
    float nearer = is_level ? 0.01 : (radius + length(second)) * max(1.5, 0.75 / slant);
    if (is_level) {  // it stays in the plane of its exposed face, which something else may lie in or stand on
        float lean = dot(across, shifted(clip, first)), thin = max(abs(lean), 1e-6);
        float longer = min(reach / thin, 20.0);
        float below = is_flat ? 0.0 : dot(across, shifted(clip, second));
        reach = abs(lean) * longer;
        vec3 aside = first * (lean < 0.0 ? -1.0 : 1.0);
        vec3 corner = aside * (in_shape.x * longer - clamp(below / thin, -10.0, 10.0)) + (is_flat ? vec3(0.0) : second);
        gl_Position = clip_from_relative * vec4(relative + corner, 1.0);
    } else {
        gl_Position = clip;
        gl_Position.xy += across * in_shape.x * reach / half_size * clip.w;
    }
    vec4 end = clip_from_relative * vec4(in_front(relative + axis, -axis), 1.0);
    gl_Position.z *= clip.w * lifted(clip, end, nearer, fades.y / (2.0 * wide * clip.w));
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
    width_times_depth = 1e9;
    fades = FADING;
    if (in_shape.y >= 0.0) {
        vec3 axis = turned(row, in_axis), first = turned(row, in_first), second = turned(row, in_second);
        vec4 clip = clip_from_relative * vec4(in_front(relative, axis), 1.0);
        bool is_round = in_shape.y > 0.5;
        fades = fading(has_edges(first, second, is_round));
        if (clip.w > 0.5 * NEAREST)
            width_times_depth = clip.w * half_width(clip, across_bar(clip, axis), first, second, is_round);
    }
#endif
}
