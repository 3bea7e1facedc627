// A map whose mipmaps are means by solid angle: radiance times the row's weight, and that in alpha.

uniform sampler2D environment;  // lat-long, its first row is the top

in vec2 ndc;
out vec4 weighed;

const float PI = 3.14159265358979;

void main() {
    vec2 uv = 0.5 + 0.5 * ndc;
    float weight = sin(PI * uv.y);  // cos above − cos below, but for a factor
    weighed = vec4(weight * textureLod(environment, uv, 0.0).rgb, weight);
}
