// Averages the samples of linear light in each pixel of an edge.
// #include edge_place.glsl

uniform usampler2D wanted;
uniform sampler2D samples;

layout(location = 0) out vec4 out_color;

in vec3 direction;

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    int count = texelFetch(wanted, pixel, 0).r != 0u ? SAMPLES : 0;
    vec3 sum = vec3(0.0);
    for (int row = 0; row < count; row++) sum += texelFetch(samples, texel_of(pixel, row), 0).rgb;
    out_color = vec4(sqrt(sum / float(SAMPLES)), 1.0 + direction.x * 0.0);
}
