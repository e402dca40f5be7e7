// How wide a bar is on the image, and where the edges of its ribbon lie. Included by the surface shader's vertices.

#ifdef BAR
uniform vec2 half_size;         // of the image [px]
uniform mat2 pixels;            // of the photograph from clip space [px]
in vec3 in_axis;                // from here to the other end of a segment
in vec3 in_first;               // half axes of the cross-section
in vec3 in_second;
in vec3 in_shape;               // side of a ribbon; 1 for round, 0 for rectangular, 0.25 for embedded in a
                                // surface, -1 for no bar; which end, 1 or -1

// [px] Widths between the first two of which a surface gives way to its ribbon, as in ribbons.py; from which down its
// ribbon grows; down to which its surface stays whole. A bar with edges gives way sooner, because a side of it is a
// fraction as wide, and its ribbon is whole before its surface fades: else what lies behind would show through its middle.
#ifdef SAMPLED  // further samples show edges down to a fraction of a pixel
const vec4 FADING = vec4(0.24, 0.4, 0.28, 0.36), EDGED_FADING = FADING;
#else
const vec4 FADING = vec4(1.5, 2.5, 1.75, 2.25);
const vec4 EDGED_FADING = vec4(6.0, 8.0, 7.0, 7.0);
#endif
const float NEAREST = 0.3;                  // [m] in front of the camera

bool is_embedded() {
    return in_shape.y > 0.1 && in_shape.y < 0.4;
}

// Where a place goes on the image if it is shifted [px].
vec2 shifted(vec4 clip, vec3 way) {
    vec4 change = clip_from_relative * vec4(way, 0.0);
    return pixels * ((change.xy - clip.xy / clip.w * change.w) / clip.w);
}

// Direction across a bar on the image [1].
vec2 across_bar(vec4 clip, vec3 axis) {
    vec2 along = shifted(clip, axis);
    float size = length(along);
    return size > 1e-6 ? vec2(-along.y, along.x) / size : vec2(1.0, 0.0);
}

vec4 fading(bool is_edged) {
    return is_edged && !is_embedded() ? EDGED_FADING : FADING;
}

// Whether a bar has two sides that differ in light: it is neither round nor flat.
bool has_edges(vec3 first, vec3 second, bool is_round) {
    return !is_round && dot(second, second) >= 1e-4 * dot(first, first);
}

// Half the width of a bar on the image [px].
float half_width(vec4 clip, vec2 across, vec3 first, vec3 second, bool is_round) {
    float one = dot(across, shifted(clip, first)), other = dot(across, shifted(clip, second));
    return is_round ? sqrt(one * one + other * other) : abs(one) + abs(other);
}
#endif
