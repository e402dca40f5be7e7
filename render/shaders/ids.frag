// Ids and depth alone, for the exact images beside a supersampled photograph.
// #include material.glsl

in vec3 normal;

layout(location = 0) out uint out_draw;
layout(location = 1) out float out_depth;
#ifdef NORMALS
layout(location = 2) out vec4 out_normal;
#endif
#ifdef TRIANGLES
layout(location = 2) out uint out_triangle;
#endif

#ifdef CREASES
// #include crease.glsl
#endif

void main() {
#ifdef STEADY
    if (!(gl_FragCoord.w > 0.0 && gl_FragCoord.w < 3e38)) discard;  // a triangle seen edge-on may have no depth
#endif
#ifdef CUT_OUT
    if (look_up_albedo().a < options.x) discard;
#endif
    bool kept = sides == 2u || gl_FrontFacing != (sides != 0u);
    vec3 face = normalize(normal + vec3(0.0, 0.0, 1e-12)) * (kept ? 1.0 : -1.0);
#if defined(CREASES) && !defined(CUT_OUT)
    out_draw = creased(draw + 1u, face);
#else
    out_draw = draw + 1u;
#endif
    out_depth = 1.0 / gl_FragCoord.w;
#ifdef NORMALS
    out_normal = vec4(face, 1.0);
#endif
#ifdef TRIANGLES
    out_triangle = uint(gl_PrimitiveID);
#endif
}
