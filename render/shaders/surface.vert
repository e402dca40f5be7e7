// Places a vertex relative to the camera: what is large was subtracted in float64 before it came here.
// #include rows.glsl

layout(std430, binding = 2) readonly buffer Offsets { vec4 offsets[]; };

uniform mat4 clip_from_relative;

in vec3 in_position;
in vec3 in_normal;
in vec2 in_st;
in vec2 in_st1;
in vec4 in_color;
in uint in_draw;

out vec3 relative;
out vec3 normal;
out vec2 st;
out vec2 st1;
out vec2 albedo_place;
out vec2 roughness_place;
out vec2 normal_place;
out vec2 metallic_place;
flat out vec3 detail_frequencies;
out vec3 vertex_color;
flat out uint draw;

vec2 place(vec4 map[2]) {
    vec3 source = vec3(map[1].w > 0.5 ? in_st1 : in_st, 1.0);
    return vec2(dot(map[0].xyz, source), dot(map[1].xyz, source));
}

void main() {
    Draw row = draws[in_draw];
    relative = vec3(dot(row.linear[0].xyz, in_position), dot(row.linear[1].xyz, in_position),
                    dot(row.linear[2].xyz, in_position)) + offsets[in_draw].xyz;
    normal = vec3(dot(row.cofactor[0].xyz, in_normal), dot(row.cofactor[1].xyz, in_normal),
                  dot(row.cofactor[2].xyz, in_normal));
    st = in_st;
    st1 = in_st1;
    Material material = materials[row.material.x];
    albedo_place = place(material.albedo);
    roughness_place = place(material.roughness);
    normal_place = place(material.normal);
    metallic_place = place(material.metallic);
    detail_frequencies = material.frequencies.xyz;
    vertex_color = in_color.rgb;
    draw = in_draw;
    gl_Position = clip_from_relative * vec4(relative, 1.0);
}
