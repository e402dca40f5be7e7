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
flat out uint mirrored;
#ifdef FACET
flat out vec3 plane;
flat out vec2 place_of_plane;
#endif

vec2 place(vec4 map[2]) {
    vec3 source = vec3(map[1].w > 0.5 ? in_st1 : in_st, 1.0);
    return vec2(dot(map[0].xyz, source), dot(map[1].xyz, source));
}

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
    mirrored = row.mirrored ? 1u : 0u;
#ifdef FACET
    plane = in_plane;
    place_of_plane = in_place;
#endif
    gl_Position = clip_from_relative * vec4(relative, 1.0);
}
