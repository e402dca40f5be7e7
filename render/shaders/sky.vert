// One triangle over the whole view, infinitely far away.

uniform mat3 world_from_clip;

out vec3 direction;

void main() {
    vec2 corner = vec2(gl_VertexID == 1 ? 3.0 : -1.0, gl_VertexID == 2 ? 3.0 : -1.0);
    direction = world_from_clip * vec3(corner, 1.0);
    gl_Position = vec4(corner, 0.0, 1.0);
}
