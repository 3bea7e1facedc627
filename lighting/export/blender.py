"""A script for Blender 4 and later: a Sun for each light, a world for the map.

Domain : Blender's world, +Z up: our (x, y, z) is its (x, −z, y), as its importers have it.
A Sun shines along its own −Z. Its strength is the irradiance on a surface that faces it, whatever
its angle, a full diameter in radians (measured with Cycles, 0 to 3 rad). The world's texture is
looked up in the map's Blender convention and its colours are radiance.
Fails  : EEVEE draws large suns as if they were small.
"""

from lighting.export.discs import (
    about,
    disc_radius_rad,
    facing_irradiance,
    light_names,
    strength_and_colour,
)
from lighting.export.orientation import quaternions, z_up
from lighting.export.rig import DomeFile
from lighting.light_set import LightSet

_SCRIPT = '''\
"""Add these lights to a scene: blender scene.blend -P <this file>"""

from pathlib import Path

import bpy

# {about}
DOME = {dome!r}
# Name, irradiance, colour, angular diameter in radians, rotation (w, x, y, z).
SUNS = [
{suns}]

scene = bpy.context.scene
collection = bpy.data.collections.new("fishlight")
scene.collection.children.link(collection)
for name, strength, colour, angle_rad, rotation in SUNS:
    sun = bpy.data.lights.new(name, "SUN")
    sun.energy = strength
    sun.color = colour
    sun.angle = angle_rad
    lamp = bpy.data.objects.new(name, sun)
    lamp.rotation_mode = "QUATERNION"
    lamp.rotation_quaternion = rotation
    collection.objects.link(lamp)

scene.world = bpy.data.worlds.new("fishlight")
scene.world.use_nodes = True
nodes, links = scene.world.node_tree.nodes, scene.world.node_tree.links
nodes.clear()
background = nodes.new("ShaderNodeBackground")
background.inputs["Color"].default_value = (0, 0, 0, 1)
links.new(background.outputs["Background"], nodes.new("ShaderNodeOutputWorld").inputs["Surface"])
if DOME is not None:
    texture = nodes.new("ShaderNodeTexEnvironment")
    texture.image = bpy.data.images.load(str(Path(__file__).with_name(DOME)))
    texture.image.colorspace_settings.name = "Linear Rec.709"
    links.new(texture.outputs["Color"], background.inputs["Color"])
'''


def to_blender(lights: LightSet, dome: DomeFile | None) -> bytes:
    """Return a Python script that adds the lights, and the dome's map beside it, to a scene."""
    strength, colour = strength_and_colour(facing_irradiance(lights))
    suns = zip(
        light_names(lights),
        strength.tolist(),
        map(tuple, colour.tolist()),
        (2 * disc_radius_rad(lights)).tolist(),
        map(tuple, quaternions(z_up(lights.directions)).tolist()),
        strict=True,
    )
    script = _SCRIPT.format(
        about=about(lights),
        dome=dome and dome.name,
        suns="".join(f"    {sun!r},\n" for sun in suns),
    )
    return script.encode()
