// What is seen through each pixel: where it is, how it faces, how it reflects.

uniform vec3 eye;
uniform vec3 base_colour;
uniform float roughness;
uniform float metalness;
uniform float specular;
uniform sampler2D base_colour_texture;          // sRGB-coded, decoded by the sampler
uniform sampler2D roughness_metalness_texture;

in vec3 world_position;
in vec3 world_normal;
in vec2 uv;
in vec3 colour;

layout(location = 0) out vec4 position_hit;      // w is 1 where something was hit
layout(location = 1) out vec4 normal_roughness;
layout(location = 2) out vec4 face_normal_f90;
layout(location = 3) out vec4 diffuse_reflectance;
layout(location = 4) out vec4 f0;                // mirror reflectance at normal incidence

const float DIELECTRIC_F0 = 0.04;  // refractive index 1.5, as in glTF

void main() {
    vec3 base = base_colour * colour * texture(base_colour_texture, uv).rgb;
    vec2 factors = texture(roughness_metalness_texture, uv).rg;
    float rough = roughness * factors.r;
    float metal = metalness * factors.g;

    // Both normals look to the viewer's side of the face: files disagree about winding, and
    // surfaces without thickness are seen from both sides.
    vec3 face_normal = cross(dFdx(world_position), dFdy(world_position));
    face_normal = dot(face_normal, face_normal) > 0.0 ? normalize(face_normal)
                                                      : normalize(world_normal);
    if (dot(face_normal, eye - world_position) < 0.0) face_normal = -face_normal;
    vec3 shading_normal = dot(world_normal, world_normal) > 0.0 ? normalize(world_normal)
                                                                : face_normal;  // they cancel
    if (dot(shading_normal, face_normal) < 0.0) shading_normal = -shading_normal;

    position_hit = vec4(world_position, 1.0);
    normal_roughness = vec4(shading_normal, rough);
    face_normal_f90 = vec4(face_normal, mix(specular, 1.0, metal));
    diffuse_reflectance = vec4(base * (1.0 - metal), 0.0);
    f0 = vec4(mix(vec3(DIELECTRIC_F0 * specular), base, metal), 0.0);
}
