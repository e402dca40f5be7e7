// Depth alone, anew, of a triangle that is so thin that the rasterizer cannot tell how its depth changes.

flat in vec3 plane;             // 1 / depth at a place [1/m], and its change per pixel
flat in vec2 place_of_plane;    // [px]

layout(location = 0) out float out_depth;

const float FARTHEST = 0.01;    // from the rasterizer's depth: a pixel just beside a triangle keeps that

void main() {
    if (!(gl_FragCoord.w > 0.0 && gl_FragCoord.w < 3e38)) discard;  // seen edge-on it may have no depth
    float exact = plane.x + dot(plane.yz, gl_FragCoord.xy - place_of_plane);
    out_depth = 1.0 / (abs(exact - gl_FragCoord.w) < FARTHEST * gl_FragCoord.w ? exact : gl_FragCoord.w);
}
