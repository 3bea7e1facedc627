// One light's map of depth: orthographic, along the light.

uniform vec4 row_u;  // world position (x, y, z, 1) → tile coordinate, 0 … 1
uniform vec4 row_v;
uniform vec4 row_depth;

in vec3 position;

void main() {
    vec4 point = vec4(position, 1.0);
    vec3 tile = vec3(dot(row_u, point), dot(row_v, point), dot(row_depth, point));
    gl_Position = vec4(2.0 * tile - 1.0, 1.0);
}
