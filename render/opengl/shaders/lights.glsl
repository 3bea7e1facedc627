// BATCH distant lights. Light 4 × SIDE² at a time: of each pixel's SIDE² turns, every one has up to
// four, light k the turn k mod SIDE².

struct Light {
    vec4 row_u;       // world position (x, y, z, 1) → coordinate in the light's tile, 0 … 1
    vec4 row_v;
    vec4 row_depth;   // → depth, 0 … 1
    vec4 direction;   // toward the light; w widens α², for the light's angular radius
    vec4 irradiance;  // ∫L dω; w is `half` of the light's irradiance curve
    vec4 mirrored;    // ∫L dω that a surface shows of it which mirrors the map
    vec4 tile;        // origin of the tile in the atlas (xy), the tile's width in the atlas (z)
    vec4 disc;        // s, −1/s², p and q of the curve
};

const int TURNS = SIDE * SIDE;
const int BATCH = 4 * TURNS;

layout(std140) uniform Lights {
    Light lights[BATCH];
};

uniform int light_count;
