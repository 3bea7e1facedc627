"""A ball on a ground and its pictures, drawn by OpenGL."""

import math

import numpy as np

from render.opengl.renderer import Renderer
from render.scenes.default_scene import sphere
from render.scenes.scene import Camera, Ground, Material, Scene
from tests.render.brute_force import SphereScene

REFLECTANCE = (0.8, 0.5, 0.2)
FROM_ABOVE = Camera(np.array([0.0, 3.0, 4.0]), np.zeros(3), math.radians(40), (80, 60))
MATT = Material((0.6, 0.6, 0.6), specular=0.0)
GLOSSY = Material((0.7, 0.5, 0.3), roughness=0.4)
BALL = SphereScene((0.0, 0.5, 0.0), 0.5, GLOSSY, Ground(0.0, REFLECTANCE, 20.0))
BALL_CAMERA = Camera(np.array([1.0, 1.2, 2.5]), np.array([0.0, 0.4, 0.0]), 0.7, (120, 90))


def ball_mesh(scene, rings=64):
    return sphere(scene.centre, scene.radius_m, scene.material, rings)


def ball_scene(scene=BALL, rings=64):
    return Scene((ball_mesh(scene, rings),), scene.ground)


def picture(ctx, scene, camera, lights, samples_per_axis=1, background=None, interleaving=1):
    with Renderer(ctx, scene, camera, samples_per_axis, interleaving) as renderer:
        return renderer.render(lights, background)


def relative_rmse(result, truth):
    return math.sqrt(np.mean((result - truth) ** 2) / np.mean(truth**2))
