// Linear light back into the photograph's code, where anything was blended over it.

uniform sampler2D blended;

layout(location = 0) out vec4 out_color;

void main() {
    vec4 light = texelFetch(blended, ivec2(gl_FragCoord.xy), 0);
    if (light.a <= 0.0) discard;
    out_color = vec4(sqrt(clamp(light.rgb, 0.0, 1.0)), 1.0);
}
