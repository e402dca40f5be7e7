// Averages 2x2 samples of linear light.

uniform sampler2D samples;
uniform int first_row;  // of the photograph

layout(location = 0) out vec4 out_color;

in vec3 direction;

void main() {
    ivec2 corner = (ivec2(gl_FragCoord.xy) + ivec2(0, first_row)) * 2;
    vec3 sum = vec3(0.0);
    for (int i = 0; i < 4; i++) {
        vec3 code = texelFetch(samples, corner + ivec2(i & 1, i >> 1), 0).rgb;
        sum += code * code;
    }
    out_color = vec4(sqrt(sum * 0.25), 1.0 + direction.x * 0.0);
}
