// Maps of depth, an instance each: orthographic, along the light, into its tile of the atlas. What is
// drawn stays inside the tile, so that nothing has to cut it off.

uniform float tile_share;  // of the atlas' side

in vec3 position;
in vec4 row_u;  // world position (x, y, z, 1) → tile coordinate, 0 … 1
in vec4 row_v;
in vec4 row_depth;
in vec2 origin;  // of the tile, 0 … 1 in the atlas

void main() {
    vec4 point = vec4(position, 1.0);
    vec2 tile = vec2(dot(row_u, point), dot(row_v, point));
    vec3 atlas = vec3(origin + tile_share * tile, dot(row_depth, point));
    gl_Position = vec4(2.0 * atlas - 1.0, 1.0);
}
