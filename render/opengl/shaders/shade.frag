// Radiance toward the eye from BATCH distant lights, added to what the target holds.
//
// L = Σ f(l, v) E (n·l) V over the lights, f = (1 − F) ρ / π + D G F / (4 n·l n·v), with the GGX
// distribution D, Smith's height-correlated G and Schlick's F: the BRDF of glTF 2.0, appendix B.
// Beside ρ, E (n·l) is the irradiance from the light's whole disc (render/discs.py), which the
// surface's horizon may cut.

struct Light {
    vec4 row_u;       // world position (x, y, z, 1) → coordinate in the light's tile, 0 … 1
    vec4 row_v;
    vec4 row_depth;   // → depth, 0 … 1
    vec4 direction;   // toward the light; w widens α², for the light's angular radius
    vec4 irradiance;  // ∫L dω; w is `half` of the light's irradiance curve
    vec4 tile;        // origin of the tile in the atlas (xy), the tile's width in the atlas (z)
    vec4 disc;        // s, −1/s², p and q of the curve
};

layout(std140) uniform Lights {
    Light lights[BATCH];
};

uniform int light_count;
uniform vec3 eye;
uniform float texel_m;         // width of a shadow map's texel in the world
uniform float texel_tile;      // and in the tile
uniform float casters_m;       // radius of the casters' bounding sphere
uniform sampler2DShadow atlas;
uniform sampler2D position_hit;
uniform sampler2D normal_roughness;
uniform sampler2D face_normal_f90;
uniform sampler2D diffuse_reflectance;
uniform sampler2D f0;

out vec4 radiance;

const float PI = 3.14159265358979;
const float SMALLEST_ALPHA2 = 4e-6;  // keeps D finite in float32 for a perfect mirror
// A bilinear look-up compares texels whose centres lie up to √2 texels away. Where the plane
// through the receiver is tilted by θ from the light, √2 sin θ texels off that plane all of them
// are behind the receiver, at any θ. What faces the light needs a little, for rounding.
const float OFFSET_TEXELS = 1.41421356;
const float SMALLEST_SINE = 0.05;

// Irradiance from a light of unit ∫L dω on a surface at this cosine to it: discs.irradiance_curves.
float received(Light light, float cosine) {
    float t = max(1.0 + cosine * cosine * light.disc.y, 0.0);
    float even = max(abs(cosine), light.disc.x - t * (light.disc.z + t * light.disc.w));
    return light.irradiance.w * (cosine + even);
}

float visibility(Light light, vec3 position, vec3 face_normal) {
    float cosine = dot(face_normal, light.direction.xyz);
    float sine = max(sqrt(max(1.0 - cosine * cosine, 0.0)), SMALLEST_SINE);
    // A face that looks away from the middle of a disc sees the part above its own horizon, in
    // directions that lean from the middle by that angle at least. The look-up moves as far as they
    // lean within a scene's radius: out of the shadow of the body that the face belongs to.
    float outward_m = OFFSET_TEXELS * texel_m * sine + casters_m * max(-cosine, 0.0);
    vec4 point = vec4(position + outward_m * face_normal, 1.0);
    vec2 tile = vec2(dot(light.row_u, point), dot(light.row_v, point));
    // The outermost two texels of a tile are free of casters: outside is lit.
    tile = clamp(tile, texel_tile, 1.0 - texel_tile);
    // The map is fixed-point, so OpenGL holds the depth it is compared with to 0 … 1: what is
    // beyond its far side is as deep as that.
    float depth = dot(light.row_depth, point);
    float unoccluded = texture(atlas, vec3(light.tile.xy + light.tile.z * tile, depth));
    // A disc behind the face cannot reach it, whatever the interpolated normal says.
    return cosine > -light.disc.x ? unoccluded : 0.0;
}

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    vec4 position = texelFetch(position_hit, pixel, 0);
    if (position.w == 0.0) discard;
    vec4 shading = texelFetch(normal_roughness, pixel, 0);
    vec4 face = texelFetch(face_normal_f90, pixel, 0);
    vec3 rho = texelFetch(diffuse_reflectance, pixel, 0).rgb;
    vec3 reflectance0 = texelFetch(f0, pixel, 0).rgb;
    vec3 n = shading.xyz;
    vec3 v = normalize(eye - position.xyz);
    float alpha = shading.w * shading.w;
    float n_v = max(dot(n, v), 1e-4);

    vec3 sum = vec3(0.0);
    for (int k = 0; k < light_count; k++) {
        Light light = lights[k];
        vec3 l = light.direction.xyz;
        float cosine = dot(n, l);
        float n_l = max(cosine, 0.0);
        vec3 h = l + v;
        h *= inversesqrt(max(dot(h, h), 1e-12));  // a light straight behind has none
        float v_h = clamp(dot(v, h), 0.0, 1.0);
        float n_h = dot(n, h);
        float alpha2 = clamp(alpha * alpha + light.direction.w, SMALLEST_ALPHA2, 1.0);
        // |n × h|² + α² (n·h)² is the usual (n·h)²(α² − 1) + 1 without its cancellation.
        vec3 n_cross_h = cross(n, h);
        float spread = dot(n_cross_h, n_cross_h) + alpha2 * n_h * n_h;
        float distribution = alpha2 / (PI * spread * spread);
        float masking = 0.5 / (n_l * sqrt(n_v * n_v * (1.0 - alpha2) + alpha2)
                             + n_v * sqrt(n_l * n_l * (1.0 - alpha2) + alpha2));  // G / (4 n·l n·v)
        float c = 1.0 - v_h;
        float c2 = c * c;
        vec3 fresnel = reflectance0 + (face.w - reflectance0) * (c2 * c2 * c);
        vec3 reflected = (1.0 - fresnel) * rho * (received(light, cosine) / PI)
                       + fresnel * (distribution * masking * n_l);
        sum += visibility(light, position.xyz, face.xyz) * reflected * light.irradiance.rgb;
    }
    radiance = vec4(sum, 0.0);
}
