// The dome behind everything: id 0, depth infinite.

uniform sampler2D panorama;
uniform mat3 dome_from_world;
uniform float code_scale;

in vec3 direction;

layout(location = 0) out vec4 out_color;
layout(location = 1) out uint out_draw;
layout(location = 2) out float out_depth;
#ifdef NORMALS
layout(location = 3) out vec4 out_normal;
#endif
#ifdef TRIANGLES
layout(location = 3) out uint out_triangle;
#endif

const float PI = 3.14159265;

void main() {
    vec3 d = normalize(dome_from_world * direction);
    vec2 place = vec2(0.5 - atan(d.x, d.z) / (2.0 * PI), acos(clamp(d.y, -1.0, 1.0)) / PI);
    vec3 light = clamp(textureLod(panorama, place, 0.0).rgb * code_scale, 0.0, 1.0);
#ifdef SAMPLES
    out_color = vec4(light, 1.0);
#else
    out_color = vec4(sqrt(light), 1.0);
#endif
    out_draw = 0u;
    out_depth = uintBitsToFloat(0x7f800000u);
#ifdef NORMALS
    out_normal = vec4(0.0);
#endif
#ifdef TRIANGLES
    out_triangle = 0u;
#endif
}
