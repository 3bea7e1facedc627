// Radiance toward the eye from a batch of distant lights, added to what the target holds.
//
// L = Σ f(l, v) E (n·l) V over the lights, f = (1 − F) ρ / π + D G F / (4 n·l n·v), with the GGX
// distribution D, Smith's height-correlated G and Schlick's F: the BRDF of glTF 2.0, appendix B.
// Beside ρ, E (n·l) is the irradiance from the light's whole disc (render/lights/discs.py), which the
// surface's horizon may cut. V is the share of the disc that is seen: from visibility.frag, where
// each pixel has looked at the lights of its turn. For all others it takes V from the pixels around
// that have theirs and show the same surface. Only V is shared; light itself is summed exactly.

// Smooth surfaces mirror of a light only what the map (reflected_map.frag) does not show.

uniform vec3 eye;
uniform float rough_alpha2;  // surfaces from here on mirror all of it
uniform sampler2D visible;
#if SIDE > 1
uniform usampler2D same_surface;
#endif
uniform sampler2D position_hit;
uniform sampler2D normal_roughness;
uniform sampler2D face_normal_f90;
uniform sampler2D diffuse_reflectance;
uniform sampler2D f0;

out vec4 radiance;

const float PI = 3.14159265358979;
const float SMALLEST_ALPHA2 = 4e-6;  // keeps D finite in float32 for a perfect mirror

// Irradiance from a light of unit ∫L dω on a surface at this cosine to it: discs.irradiance_curves.
float received(Light light, float cosine) {
    float t = max(1.0 + cosine * cosine * light.disc.y, 0.0);
    float even = max(abs(cosine), light.disc.x - t * (light.disc.z + t * light.disc.w));
    return light.irradiance.w * (cosine + even);
}

#if SIDE == 1
vec4 visibility(ivec2 pixel, int turn) {
    return texelFetch(visible, pixel, 0);
}
#else
// Of the pixels that have a turn, the nearest to each side, by a tent as wide as they are apart.
vec4 visibility(ivec2 pixel, int turn) {
    uvec2 same = texelFetch(same_surface, pixel, 0).rg;
    ivec2 ahead = (ivec2(turn % SIDE, turn / SIDE) - pixel) & (SIDE - 1);
    vec4 sum = vec4(0.0);
    float total = 0.0;
    for (int i = 0; i < 4; i++) {
        ivec2 way = ahead - SIDE * ivec2(i & 1, i >> 1);
        vec2 tent = 1.0 - abs(vec2(way)) / float(SIDE);
        float weight = tent.x * tent.y;
        if (weight == 0.0) continue;
        uint row = same[(way.y + 3) / 4] >> (8 * ((way.y + 3) % 4));
        if ((row >> (way.x + 3) & 1u) == 0u) continue;
        sum += weight * texelFetch(visible, pixel + way, 0);
        total += weight;
    }
    return total > 0.0 ? sum / total : vec4(1.0);
}
#endif

// L of a light that nothing shadows.
vec3 reflected(Light light, vec3 n, vec3 v, float alpha, vec3 rho, vec3 reflectance0, float f90) {
    float n_v = max(dot(n, v), 1e-4);
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
    vec3 fresnel = reflectance0 + (f90 - reflectance0) * (c2 * c2 * c);
    vec3 mirrored = alpha * alpha < rough_alpha2 ? light.mirrored.rgb : light.irradiance.rgb;
    return (1.0 - fresnel) * rho * (received(light, cosine) / PI) * light.irradiance.rgb
                   + fresnel * (distribution * masking * n_l) * mirrored;
}

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    vec4 position = texelFetch(position_hit, pixel, 0);
    if (position.w == 0.0) discard;
    vec4 shading = texelFetch(normal_roughness, pixel, 0);
    vec4 face = texelFetch(face_normal_f90, pixel, 0);
    vec3 rho = texelFetch(diffuse_reflectance, pixel, 0).rgb;
    vec3 reflectance0 = texelFetch(f0, pixel, 0).rgb;
    vec3 v = normalize(eye - position.xyz);
    float alpha = shading.w * shading.w;

    vec3 sum = vec3(0.0);
    for (int turn = 0; turn < min(TURNS, light_count); turn++) {
        vec4 share = visibility(pixel, turn);
        for (int c = 0; c < 4; c++) {
            int k = turn + c * TURNS;
            if (k >= light_count) break;
            Light light = lights[k];
            // A disc behind the face cannot reach it, whatever the interpolated normal says.
            if (dot(face.xyz, light.direction.xyz) <= -light.disc.x) continue;
            sum += share[c]
                 * reflected(light, shading.xyz, v, alpha, rho, reflectance0, face.w);
        }
    }
    radiance = vec4(sum, 0.0);
}
