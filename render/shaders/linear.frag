// The photograph's code as linear light, for what is blended over it; opacity 0: nothing is, yet.

uniform sampler2D codes;

layout(location = 0) out vec4 out_color;

void main() {
    vec3 code = texelFetch(codes, ivec2(gl_FragCoord.xy), 0).rgb;
    out_color = vec4(code * code, 0.0);
}
