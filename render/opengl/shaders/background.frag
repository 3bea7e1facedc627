// The environment where nothing was hit, black elsewhere; alpha is 1 where something was hit.

uniform sampler2D position_hit;
uniform sampler2D environment;  // lat-long, its first row is the top
uniform mat3 ray;               // (ndc.x, ndc.y, 1) → world direction

in vec2 ndc;
out vec4 radiance;

const float PI = 3.14159265358979;

void main() {
    float hit = texelFetch(position_hit, ivec2(gl_FragCoord.xy), 0).w;
    vec3 direction = normalize(ray * vec3(ndc, 1.0));
    float theta = acos(clamp(direction.y, -1.0, 1.0));
    float phi = atan(direction.x, direction.z);
    vec2 uv = vec2(0.5 - phi / (2.0 * PI), theta / PI);
    radiance = vec4((1.0 - hit) * textureLod(environment, uv, 0.0).rgb, hit);
}
