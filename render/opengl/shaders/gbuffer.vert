uniform mat4 world_to_clip;

in vec3 position;
in vec3 normal;
in vec2 texture_coordinate;
in vec3 vertex_colour;

out vec3 world_position;
out vec3 world_normal;
out vec2 uv;
out vec3 colour;

void main() {
    world_position = position;
    world_normal = normal;
    uv = texture_coordinate;
    colour = vertex_colour;
    gl_Position = world_to_clip * vec4(position, 1.0);
}
