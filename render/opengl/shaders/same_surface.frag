// From which of the 7 × 7 pixels around a pixel takes what they saw: those that show its surface.
// Of each turn at least one, so what is too thin to have one takes any that show something.
// Bit 8 (y + 3) + x + 3, the first four rows in r and the others in g.

uniform sampler2D position_hit;
uniform sampler2D normal_roughness;
uniform sampler2D face_normal_f90;

out uvec2 same;

const float LEAST_AGREEMENT = 0.9;  // of the normals of one surface at neighbouring pixels
const float MOST_SLOPE = 0.25;      // of the way to the neighbour, off the plane: surfaces are curved

void set(inout uvec2 bits, ivec2 way) {
    bits[(way.y + 3) / 4] |= 1u << (8 * ((way.y + 3) % 4) + way.x + 3);
}

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    ivec2 last = textureSize(position_hit, 0) - 1;
    vec4 position = texelFetch(position_hit, pixel, 0);
    vec3 normal = texelFetch(normal_roughness, pixel, 0).xyz;
    vec3 face_normal = texelFetch(face_normal_f90, pixel, 0).xyz;
    same = uvec2(0u);
    uvec2 hit = uvec2(0u);
    if (position.w == 0.0) return;
    for (int y = -3; y <= 3; y++) {
        for (int x = -3; x <= 3; x++) {
            ivec2 there = pixel + ivec2(x, y);
            if (clamp(there, ivec2(0), last) != there) continue;
            vec4 other = texelFetch(position_hit, there, 0);
            vec3 way = other.xyz - position.xyz;
            if (other.w == 0.0) continue;
            set(hit, ivec2(x, y));
            bool is_same = abs(dot(way, face_normal)) <= MOST_SLOPE * length(way)
                && dot(normal, texelFetch(normal_roughness, there, 0).xyz) > LEAST_AGREEMENT;
            if (is_same) set(same, ivec2(x, y));
        }
    }
    for (int turn = 0; turn < SIDE * SIDE; turn++) {
        uvec2 having = uvec2(0u);
        for (int i = 0; i < 4; i++) {
            ivec2 way = ivec2(turn % SIDE, turn / SIDE) - SIDE * ivec2(i & 1, i >> 1);
            if (min(way.x, way.y) > -SIDE) set(having, way);
        }
        if ((same & having) == uvec2(0u)) same |= hit & having;
    }
}
