// What is hidden from each pixel: sixteen harmonics, a byte for each, −2 … 2.

in mat4 harmonics;

layout(location = 0) out uvec4 hidden;

uint in_bytes(vec4 four) {
    uvec4 bytes = uvec4(round(clamp(127.0 + 63.5 * four, 0.0, 254.0)));
    return bytes.x | bytes.y << 8 | bytes.z << 16 | bytes.w << 24;
}

void main() {
    hidden = uvec4(in_bytes(harmonics[0]), in_bytes(harmonics[1]), in_bytes(harmonics[2]), in_bytes(harmonics[3]));
}
