// Which of 27 ways a face is turned, over the number of its draw: two faces at right angles never have the same, so that
// edges inside a draw are found, too. Included by the surface and id shaders; `passes.py` takes it off again.

const float TURNED = 0.38;      // [1] of a normal along an axis: beyond the sine of 22.5 degrees
const float FLAT = 0.004;       // [1] a pixel: a normal that changes faster is that of a round surface, which has no edges
const uint CREASE_BITS = 27u;   // from which bit on; as in passes.py

uint creased(uint number, vec3 face) {
    if (any(greaterThan(fwidth(face), vec3(FLAT)))) return number;
    uvec3 way = uvec3(greaterThan(face, vec3(-TURNED))) + uvec3(greaterThan(face, vec3(TURNED)));
    return number | ((way.x * 9u + way.y * 3u + way.z) << CREASE_BITS);
}
