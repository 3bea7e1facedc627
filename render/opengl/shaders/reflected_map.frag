// Radiance toward the eye that smooth surfaces mirror of a map, added to what the target holds.
//
// A few rays stand for the lobe, drawn by the normals that the eye sees [Heitz 2018]; each looks up
// the mean of the map over the share of the lobe that it stands for [Křivánek and Colbert 2008].
// As render/rays/lobe.py and render/lights/map_pyramid.py have it. What objects hide is black.

uniform vec3 eye;
uniform vec4 ground;            // radiance below the horizon, where w is 1; else the map has it
uniform float rough_alpha2;     // surfaces from here on mirror lights in place of the map
uniform float coarsest;         // level of the map
uniform sampler2D weighed_map;  // of weigh_map.frag
uniform sampler2D position_hit;
uniform sampler2D normal_roughness;
uniform sampler2D face_normal_f90;
uniform sampler2D f0;
uniform usampler2D hidden_sky;  // of hidden_sky.frag

out vec4 radiance;

const float PI = 3.14159265358979;
const float TURN_OF_A_RAY = 0.381966011;  // of the golden spiral
const float OVERLAP = 0.7;                // what a ray looks up, over the share that it stands for
const float WEAK_F0 = 0.1;                // of dielectrics: they scatter more than they mirror
const int MOST_TAPS = 16;

// One level, between rows linearly. What the sampler mixes is light, in which the row nearer to the
// equator has more weight: it is asked nearer to the other one.
vec4 between_rows(float u, float v, int level) {
    float rows = float(textureSize(weighed_map, level).y);
    float y = clamp(v * rows - 0.5, 0.0, rows - 1.0);
    float row = min(floor(y), rows - 2.0);
    float below = y - row;
    vec2 weight = sin(PI / rows * (row + vec2(0.5, 1.5)));
    float asked = below * weight.x / mix(weight.y, weight.x, below);
    vec4 light = textureLod(weighed_map, vec2(u, (row + 0.5 + asked) / rows), float(level));
    return light / light.a;
}

// Beside a pole, where cells are narrow, the mean of several.
vec3 mean_around(vec3 direction, float share_sr) {
    float level_part = length(direction.xz);
    float width = sqrt(share_sr);
    float rows = float(textureSize(weighed_map, 0).y);
    float lod = clamp(log2(width * rows / PI), 0.0, coarsest);
    int finer = min(int(lod), int(coarsest) - 1);
    float u = 0.5 - atan(direction.x, direction.z) / (2.0 * PI);
    float v = atan(level_part, direction.y) / PI;
    float turn = min(width / (2.0 * PI * max(level_part, 1e-6)), 1.0);
    int taps = min(int(turn * rows * exp2(-float(finer))) + 1, MOST_TAPS);
    float step = turn / float(taps);
    u += 0.5 * (step - turn);
    vec3 sum = vec3(0.0);
    for (int i = 0; i < taps; i++) {
        sum += mix(between_rows(u, v, finer), between_rows(u, v, finer + 1), lod - float(finer)).rgb;
        u += step;
    }
    return sum / float(taps);
}

vec4 harmonics_of(uint four) {
    uvec4 bytes = uvec4(four, four >> 8, four >> 16, four >> 24) & 255u;
    return (vec4(bytes) - 127.0) / 63.5;
}

// The harmonics of render/rays/hidden_sky.py, orthonormal but for these factors.
const mat4 FACTORS = mat4(0.28209479, 0.48860251, 0.48860251, 0.48860251,
                          1.09254843, 1.09254843, 0.31539157, 1.09254843,
                          0.54627422, 0.59004359, 2.89061144, 0.45704580,
                          0.37317633, 0.45704580, 1.44530572, 0.59004359);

float open_share(mat4 hidden, vec3 d) {
    vec3 d2 = d * d;
    float five = 5.0 * d2.z - 1.0;
    float sum = dot(hidden[0], vec4(1.0, d.yzx))
        + dot(hidden[1], vec4(d.xyx * d.yzz, 3.0 * d2.z - 1.0).xywz)
        + dot(hidden[2], vec4(d2.x - d2.y, d.y * (3.0 * d2.x - d2.y), d.x * d.y * d.z, d.y * five))
        + dot(hidden[3], vec4(d.z * (five - 2.0), d.x * five, d.z * (d2.x - d2.y),
                              d.x * (d2.x - 3.0 * d2.y)));
    return clamp(1.0 - sum, 0.0, 1.0);
}

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    vec4 position = texelFetch(position_hit, pixel, 0);
    if (position.w == 0.0) discard;
    vec4 shading = texelFetch(normal_roughness, pixel, 0);
    float alpha = max(shading.w * shading.w, 1e-5);
    float alpha2 = alpha * alpha;
    vec4 face = texelFetch(face_normal_f90, pixel, 0);
    vec3 reflectance0 = texelFetch(f0, pixel, 0).rgb;
    float most0 = max(max(reflectance0.r, reflectance0.g), reflectance0.b);
    if (alpha2 >= rough_alpha2 || max(most0, face.w) == 0.0) discard;

    vec3 n = shading.xyz;
    float side = n.z >= 0.0 ? 1.0 : -1.0;
    float c = -1.0 / (side + n.z);
    float d = n.x * n.y * c;
    mat3 to_world = mat3(1.0 + side * n.x * n.x * c, side * d, -side * n.x,
                         d, side + n.y * n.y * c, -n.y,
                         n);
    vec3 v = normalize(eye - position.xyz) * to_world;
    v.z = max(v.z, 1e-4);
    vec3 s = normalize(vec3(alpha * v.xy, v.z));
    float across = length(s.xy);
    vec3 t = across > 1e-6 ? vec3(-s.y, s.x, 0.0) / across : vec3(1.0, 0.0, 0.0);
    mat3 to_tangent = mat3(t, cross(s, t), s);
    float g_v = sqrt(alpha2 + (1.0 - alpha2) * v.z * v.z);

    uvec4 bytes = texelFetch(hidden_sky, pixel, 0);
    mat4 hidden = matrixCompMult(FACTORS, mat4(harmonics_of(bytes.x), harmonics_of(bytes.y),
                                               harmonics_of(bytes.z), harmonics_of(bytes.w)));
    int rays = most0 < WEAK_F0 ? FEW_RAYS : RAYS;
    vec3 sum = vec3(0.0);
    for (int k = 0; k < rays; k++) {
        float a = (float(k) + 0.5) / float(rays);
        float turn = 2.0 * PI * TURN_OF_A_RAY * (float(k) + 0.5);
        vec2 disc = sqrt(a) * vec2(cos(turn), sin(turn));
        disc.y = mix(sqrt(max(1.0 - disc.x * disc.x, 0.0)), disc.y, 0.5 + 0.5 * s.z);
        vec3 h = to_tangent * vec3(disc, sqrt(max(1.0 - dot(disc, disc), 0.0)));
        h = normalize(vec3(alpha * h.xy, max(h.z, 1e-9)));
        float v_h = dot(v, h);
        vec3 l = 2.0 * v_h * h - v;
        vec3 direction = to_world * l;
        if (l.z <= 0.0 || dot(direction, face.xyz) <= 0.0) continue;
        float g_l = sqrt(alpha2 + (1.0 - alpha2) * l.z * l.z);
        float shadowed = l.z * (v.z + g_v) / (v.z * g_l + l.z * g_v);  // G₂ / G₁
        float spread = dot(h.xy, h.xy) + alpha2 * h.z * h.z;
        float share_sr = OVERLAP * 2.0 * PI * spread * spread * (v.z + g_v) / (alpha2 * float(rays));
        float left = 1.0 - v_h;
        float left2 = left * left;
        vec3 fresnel = mix(reflectance0, vec3(face.w), left2 * left2 * left);
        bool meets_ground = ground.w > 0.0 && direction.y < 0.0;
        vec3 met = meets_ground ? ground.rgb : mean_around(direction, share_sr);
        sum += shadowed * open_share(hidden, direction) * fresnel * met;
    }
    radiance = vec4(sum / float(rays), 0.0);
}
