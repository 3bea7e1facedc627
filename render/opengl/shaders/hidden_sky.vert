uniform mat4 world_to_clip;

in vec3 position;
in vec4 order_0_1;  // harmonics of what is hidden, as hidden_sky.py has them
in vec4 order_2;
in vec4 order_2_3;
in vec4 order_3;

out mat4 harmonics;

void main() {
    harmonics = mat4(order_0_1, order_2, order_2_3, order_3);
    gl_Position = world_to_clip * vec4(position, 1.0);
}
