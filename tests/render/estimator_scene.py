"""Surfaces around a box under a small map, and what they reflect: a plain sum over the sky.

The oracle of the estimators: every cell of the map is looked at in many directions, with the
textbook form of the reflectance and a slab test against the box. It shares no code with them.
"""

import numpy as np

from lighting.maps.environment import EnvironmentMap
from lighting.sphere.latlong import grid_to_direction, solid_angles
from render.estimators.contract import Setting, Shadows
from render.rays.embree import Occluders, occluded16_address
from render.reference.surfaces import (
    ALPHA2,
    F0,
    F90,
    FACE_NORMAL,
    FIELDS,
    HIT,
    MATT,
    NORMAL,
    ORIGIN,
    TO_EYE,
    scene_tables,
)
from render.scenes.scene import Material, Scene
from tests.render.boxes import box
from tests.render.brute_force import reflectance

LOW, HIGH = np.array([-0.5, 0.6, -0.7]), np.array([0.9, 1.1, 0.4])
MATERIALS = (
    Material((0.8, 0.6, 0.4), specular=0.0),
    Material((0.9, 0.8, 0.7), roughness=0.5, metalness=1.0),
    Material((0.5, 0.3, 0.1), roughness=0.6),
)


def environment(radiance):
    seen = np.ones(radiance.shape[:2], bool)
    return EnvironmentMap(np.asarray(radiance, np.float32), seen, ~seen)


def uneven_map(rows=8, seed=0):
    """A map of which some cells outshine the rest fifty times, and some are black."""
    rng = np.random.default_rng(seed)
    radiance = (rng.random((rows, 2 * rows, 3)) + 0.1) * 50 ** rng.random((rows, 2 * rows, 1)) ** 2
    radiance[2, 3:6] = 0.0
    return environment(radiance)


def packet(seed=1):
    """Return sixteen surfaces (1, FIELDS, 16) below, beside and above the box; the last no hit."""
    rng = np.random.default_rng(seed)
    surface = np.zeros((1, FIELDS, 16), np.float32)
    for i in range(15):
        normal = rng.normal(size=3)
        normal /= np.linalg.norm(normal)
        to_eye = normal + 0.9 * _unit(rng.normal(size=3))
        material = MATERIALS[i % 3]
        base = np.array(material.base_colour)
        specular, metal = material.specular, material.metalness
        surface[0, ORIGIN : ORIGIN + 3, i] = rng.uniform(-1, 1, 3) * [1, 0.5, 1]
        surface[0, NORMAL : NORMAL + 3, i] = surface[0, FACE_NORMAL : FACE_NORMAL + 3, i] = normal
        surface[0, TO_EYE : TO_EYE + 3, i] = _unit(to_eye)
        surface[0, MATT : MATT + 3, i] = base * (1 - metal) / np.pi
        surface[0, F0 : F0 + 3, i] = (1 - metal) * 0.04 * specular + metal * base
        surface[0, F90, i] = (1 - metal) * specular + metal
        surface[0, ALPHA2, i] = material.roughness**4
        surface[0, HIT, i] = 1
    return surface


def occluders():
    mesh = box(LOW, HIGH)
    return Occluders(mesh.positions, mesh.faces)


def setting(light, held, bounces=1):
    """Return the setting of a map among `occluders`, without a ground."""
    centre = 0.5 * (LOW + HIGH)
    sphere = np.array([*centre, 1.001 * np.linalg.norm(HIGH - centre)], np.float32)
    shadows = Shadows(occluded16_address(), held.address, sphere, -2.0)
    return Setting(light, shadows, scene_tables(Scene((box(LOW, HIGH),), None)), bounces)


def brute_force(light, surface, per_side=16):
    """Return what the surfaces of a packet reflect, (3, 16), by `per_side`² looks at each cell."""
    rows = light.height
    n = per_side
    fine = (np.arange(rows * n) + 0.5) / n - 0.5, (np.arange(2 * rows * n) + 0.5) / n - 0.5
    column, row = np.meshgrid(fine[1], fine[0])
    toward = grid_to_direction(np.stack([column, row], axis=-1), rows).reshape(-1, 3)
    area = np.repeat(solid_angles(rows * n), 2 * rows * n)
    arriving = np.repeat(np.repeat(light.radiance, n, axis=0), n, axis=1).reshape(-1, 3)
    out = np.zeros((3, 16))
    for i in np.flatnonzero(surface[HIT]):
        normal = surface[NORMAL : NORMAL + 3, i].astype(float)
        cosine = toward @ normal
        lit = (cosine > 0) & ~_meets_box(surface[ORIGIN : ORIGIN + 3, i].astype(float), toward)
        to_eye = surface[TO_EYE : TO_EYE + 3, i].astype(float)
        f = reflectance(MATERIALS[i % 3], normal, to_eye, toward[lit])
        out[:, i] = (f * arriving[lit] * (cosine[lit] * area[lit])[:, None]).sum(axis=0)
    return out


def _meets_box(origin, toward):
    with np.errstate(divide="ignore"):
        first, second = (LOW - origin) / toward, (HIGH - origin) / toward
    enter = np.minimum(first, second).max(axis=1)
    leave = np.maximum(first, second).min(axis=1)
    return (leave > np.maximum(enter, 0)) & (leave > 0)


def _unit(vector):
    return vector / np.linalg.norm(vector)
