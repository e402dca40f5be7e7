// Blocks the depth of samples in pixels that keep their one sample.
// #include edge_place.glsl

uniform usampler2D wanted;

in vec3 direction;

void main() {
    ivec2 pixel = pixel_of(ivec2(gl_FragCoord.xy));
    bool open = pixel.x >= 0 && pixel.x < textureSize(wanted, 0).x && texelFetch(wanted, pixel, 0).r != 0u;
    gl_FragDepth = open ? 0.0 : 1.0 + direction.x * 0.0;
}
