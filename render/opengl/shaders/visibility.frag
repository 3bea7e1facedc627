// What share of each of four lights' discs a pixel sees: those that have the pixel's turn.
//
// Percentage-closer soft shadows [Fernando 2005] of lights of known extent. Seen from the receiver,
// a disc of angular radius a is the base of a cone. What the map has inside the cone hides some of
// the base; its mean distance says how wide the cone is where casters are, and of the map's points
// in that circle those hide the light that are nearer to it than the receiver. All are taken from
// the same TAPS points, spread over what the cone can meet. What lies below the receiver's own plane
// does not count: shade.frag knows what a horizon hides, so that a convex body never shades itself.

uniform float texel_m;         // width of a shadow map's texel in the world
uniform float tile_px;         // texels along the side of a tile
uniform float error_m;         // how far casters may be off the surfaces that they stand for
uniform sampler2D atlas;       // not filtered
uniform sampler2D position_hit;
uniform sampler2D face_normal_f90;

out vec4 visible;

// A bilinear look-up compares texels whose centres lie up to √2 texels away. Where the plane
// through the receiver is tilted by θ from the light, √2 sin θ texels off that plane all of them
// are behind the receiver, at any θ. What faces the light needs a little, for rounding.
const float OFFSET_TEXELS = 1.41421356;
const float SMALLEST_SINE = 0.05;
const float BLUR_TEXELS = 0.7;  // what the cone is wider by, so that texels leave no steps
const float PI = 3.14159265358979;
const float GOLDEN_ANGLE = 2.39996323;
const float GOLDEN_RATIO = 0.61803399;
const int DITHER[16] = int[16](0, 8, 2, 10, 12, 4, 14, 6, 3, 11, 1, 9, 15, 7, 13, 5);

vec2 in_atlas(Light light, vec2 tile) {
    // The outermost two texels of a tile are free of casters: outside is lit.
    return light.tile.xy + light.tile.z * clamp(tile, 1.0 / tile_px, 1.0 - 1.0 / tile_px);
}

// Whether what casts is in the way at all, between texel centres linearly.
float seen_point(Light light, vec2 tile, float depth) {
    vec2 at = in_atlas(light, tile) * vec2(textureSize(atlas, 0)) - 0.5;
    ivec2 corner = ivec2(floor(at));
    vec4 casters = vec4(texelFetch(atlas, corner, 0).r, texelFetch(atlas, corner + ivec2(1, 0), 0).r,
                        texelFetch(atlas, corner + ivec2(0, 1), 0).r, texelFetch(atlas, corner + 1, 0).r);
    vec4 is_seen = step(min(depth, 1.0), casters);
    vec2 along = mix(is_seen.xz, is_seen.yw, at.x - float(corner.x));
    return mix(along.x, along.y, at.y - float(corner.y));
}

// The receiver lies at `depth` under `tile`; `normal` is its face's, in the tile's frame.
float seen_share(Light light, vec2 tile, float depth, vec3 normal, float dither) {
    float sine = light.disc.x;
    float spread = sine * inversesqrt(max(1.0 - sine * sine, 1e-4));  // tan a
    float reach = max(depth, 0.0) * spread;  // of the cone, where the first caster may be
    if (reach * tile_px < 1.0) return seen_point(light, tile, depth);
    float blur = BLUR_TEXELS / tile_px;
    reach += blur;
    float jitter = 0.125 + 0.75 * fract(4.0 * dither);
    bool is_caster[TAPS];
    float weight = 0.0, radius = 0.0;
    for (int i = 0; i < TAPS; i++) {
        // Even along the radius: denser toward the axis, where the cone meets what is near.
        float off = (float(i) + jitter) / float(TAPS);
        float angle = GOLDEN_ANGLE * float(i) + 2.0 * PI * dither;
        vec2 way = reach * off * vec2(cos(angle), sin(angle));
        float caster = texture(atlas, in_atlas(light, tile + way)).r;
        float cone = ((depth - caster) * spread + blur) / reach;
        // Where nothing casts the map holds 1, its far side; receivers may lie beyond.
        is_caster[i] = caster < min(depth, 1.0) && dot(normal, vec3(way, caster - depth)) > 0.0;
        if (is_caster[i] && off < cone) {
            float area = off / (cone * cone);  // of the base that it hides
            weight += area;
            radius += area * cone;
        }
    }
    if (weight == 0.0) return 1.0;
    float inside = clamp(ceil(radius / weight * float(TAPS) - jitter), 1.0, float(TAPS));
    float hidden = 0.0;
    for (int i = 0; i < int(inside); i++) hidden += is_caster[i] ? float(i) + jitter : 0.0;
    hidden /= inside * (0.5 * (inside - 1.0) + jitter);
    // Of the disc's area, what is above the face's horizon.
    float height = clamp(-normal.z / sine, -0.999, 0.999);
    float above = 0.5 + (height * sqrt(1.0 - height * height) + asin(height)) / PI;
    return max(1.0 - hidden / above, 0.0);
}

float visibility(Light light, vec3 position, vec3 face_normal, float dither) {
    float cosine = dot(face_normal, light.direction.xyz);
    // Behind the face: shade.frag leaves it out. Neighbours that face it must not take it for shadow.
    if (cosine <= -light.disc.x) return 1.0;
    float sine = max(sqrt(max(1.0 - cosine * cosine, 0.0)), SMALLEST_SINE);
    vec4 point = vec4(position + (OFFSET_TEXELS * texel_m * sine + error_m) * face_normal, 1.0);
    mat4x3 to_tile = transpose(mat3x4(light.row_u, light.row_v, light.row_depth));
    vec3 at = to_tile * point;
    vec3 normal = normalize(to_tile * vec4(face_normal, 0.0));
    return seen_share(light, at.xy, at.z, normal, dither);
}

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    vec4 position = texelFetch(position_hit, pixel, 0);
    visible = vec4(0.0);
    if (position.w == 0.0) return;
    vec3 face_normal = texelFetch(face_normal_f90, pixel, 0).xyz;
    int turn = pixel.x % SIDE + SIDE * (pixel.y % SIDE);
    ivec2 block = pixel / SIDE;  // pixels of one turn side by side
    float dither = float(DITHER[block.x % 4 + 4 * (block.y % 4)]) / 16.0;
    for (int c = 0; c < 4; c++) {
        int k = turn + c * TURNS;
        if (k >= light_count) break;
        visible[c] = visibility(
            lights[k], position.xyz, face_normal, fract(dither + GOLDEN_RATIO * float(k)));
    }
}
