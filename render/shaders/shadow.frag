// Depth alone; cut-outs are cut here too.
// #include material.glsl

void main() {
#ifdef CUT_OUT
    if (look_up_albedo().a < options.x) discard;
#endif
}
