// How much of the sun a place on a surface sees. Included by the surface shader.

// Leaves are small and many, and water mirrors but blurred images: a sharp shadow is enough there, and costs half.
#if defined(SOFT) && !defined(CUT_OUT) && !defined(ABOVE)
#define PENUMBRA
#endif

#ifdef SUN
uniform sampler2D shadow_map;   // three square maps side by side: sharp, near, far
uniform vec3 sun_axes[3];       // right and up of the sun's view [1], and the way of its rays over the maps' depth [1/m]
uniform vec3 sun_eye;           // camera centre along them: [m], [m] and depth [1]
uniform vec4 shadow_maps[3];    // of each map 1 / half width, centre, usable half width
uniform float sun_depth;        // the maps' depth [m]
uniform float sun_blur;         // width of a penumbra over the distance of what throws it [1]

const float STEEPEST = 8.0;     // slope against the sun's view: where it is steeper, hardly any sun falls
const float MOST_MORE = 40.0;   // slope beyond it that still gives slack: rays that all but graze a surface
const float SLACK = 0.003;      // [m] and of a texel: a surface does not shade itself
const float SLACK_TEXELS = 0.15;
const float NARROWEST = 1.5, WIDEST = 3.0;  // [texels] of a filter: narrower, texels would show; wider, it costs more

#ifdef PENUMBRA
// How much of two neighbouring texels a filter covers along one axis; all in texels.
vec2 covered(float middle, float width, float texel) {
    vec2 centers = vec2(texel, texel + 1.0);
    return clamp(min(centers + 0.5, middle + 0.5 * width) - max(centers - 0.5, middle - 0.5 * width), 0.0, 1.0);
}
#endif

// How the map's depth changes along right and up of the sun's view on the plane of this triangle, as far as `STEEPEST`
// lets it, and by how much it changes more than that [1/m].
vec3 sun_slope(vec3 ray) {
    vec3 across = dFdx(ray), down = dFdy(ray);
    float area = across.x * down.y - across.y * down.x;
    vec2 slope = vec2(across.z * down.y - down.z * across.y, across.x * down.z - down.x * across.z);
    slope /= abs(area) > 1e-16 ? area : 1.0;
    vec2 held = clamp(slope, -STEEPEST / sun_depth, STEEPEST / sun_depth), more = abs(slope - held);
    return vec3(held, min(more.x + more.y, MOST_MORE / sun_depth));
}

// A filter as wide as the penumbra that the sun's disc and what hides it make. The plane of the surface carries the
// look-up from texel to texel: no offset is needed, which would move the edge of the shadow.
// Source: Fernando, Percentage-closer soft shadows, SIGGRAPH 2005 sketches; Isidoro, Shadow mapping: GPU-based tips and
// techniques, GDC 2006 (receiver plane).
float sun_visibility() {
    vec3 ray = vec3(dot(sun_axes[0], relative), dot(sun_axes[1], relative), dot(sun_axes[2], relative));
#ifdef RIBBON
    vec3 slope = vec3(0.0);
#else
    vec3 slope = sun_slope(ray);
#endif
    ray += sun_eye;
    vec2 sharp = abs(ray.xy * shadow_maps[0].x + shadow_maps[0].yz);
    vec2 near = abs(ray.xy * shadow_maps[1].x + shadow_maps[1].yz);
    bool in_near = max(near.x, near.y) < shadow_maps[1].w;
    bool in_sharp = max(sharp.x, sharp.y) < shadow_maps[0].w && !(in_near && shadow_maps[1].x > shadow_maps[0].x);
    vec4 map = in_sharp ? shadow_maps[0] : in_near ? shadow_maps[1] : shadow_maps[2];
    float size = float(textureSize(shadow_map, 0).y), texel = 2.0 / (map.x * size);  // [m]
    vec2 inside = ray.xy * map.x + map.yz;
    vec2 step = slope.xy * texel;
    if (max(abs(inside.x), abs(inside.y)) > map.w) return 1.0;

    vec2 texels = (inside * 0.5 + 0.5) * size - 0.5;
    vec2 corner = floor(texels), part = texels - corner;
    vec2 unit = vec2(1.0 / 3.0, 1.0) / size;
    vec2 origin = (corner + vec2((in_sharp ? 0.0 : in_near ? 1.0 : 2.0) * size, 0.0)) * unit;
    // Where the plane is steeper than the look-up follows, it falls behind by this much over half a filter.
    float depth = ray.z - (SLACK + SLACK_TEXELS * texel) / sun_depth - slope.z * (0.5 * WIDEST + 0.5) * texel;
    const vec4 RIGHT = vec4(0.0, 1.0, 1.0, 0.0), UP = vec4(1.0, 1.0, 0.0, 0.0);  // the texels of a gather
#ifdef PENUMBRA
    vec4 gaps[4];  // how far the surface lies behind what the texels of four gathers show [1]
    float blocked = 0.0, behind = 0.0, first = depth - dot(step, part + 1.0);
    for (int number = 0; number < 4; number++) {
        vec2 shift = vec2(2 * (number & 1), 2 * (number >> 1));
        vec4 held = textureGather(shadow_map, origin + shift * unit);
        gaps[number] = first + step.x * (shift.x + RIGHT) + step.y * (shift.y + UP) - held;
        vec4 hidden = vec4(greaterThan(gaps[number], vec4(0.0)));
        blocked += dot(hidden, vec4(1.0));
        behind += dot(hidden, gaps[number]);
    }
    float width = clamp(behind / max(blocked, 1.0) * sun_depth * sun_blur / texel, NARROWEST, WIDEST);
    float open = 0.0;
    for (int number = 0; number < 4; number++) {
        vec2 wide = covered(part.x + 1.0, width, float(2 * (number & 1)));
        vec2 high = covered(part.y + 1.0, width, float(2 * (number >> 1)));
        vec4 lit = vec4(lessThanEqual(gaps[number], vec4(0.0)));
        open += high.y * (wide.x * lit.x + wide.y * lit.y) + high.x * (wide.x * lit.w + wide.y * lit.z);
    }
    return open / (width * width);
#else
    vec4 gap = depth - dot(step, part) + step.x * RIGHT + step.y * UP - textureGather(shadow_map, origin + unit);
    vec4 lit = vec4(lessThanEqual(gap, vec4(0.0)));
    return mix(mix(lit.w, lit.z, part.x), mix(lit.x, lit.y, part.x), part.y);
#endif
}
#endif
