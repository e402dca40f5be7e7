// Depth alone; cut-outs are cut here too.
// #include rows.glsl
// #include material.glsl

void main() {
#ifdef CUT_OUT
    Material material = materials[draws[draw].material.x];
    if (look_up_albedo(material).a < material.options.x) discard;
#endif
}
