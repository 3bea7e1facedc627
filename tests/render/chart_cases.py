"""Cases of the renderers' chart that are drawn and measured at once."""

from contextlib import contextmanager

import numpy as np

from render.measures import chart
from render.measures.picture_errors import Truth
from render.scenes.default_scene import sphere
from render.scenes.scene import Camera, Ground, Material, Scene
from tests.environments import outdoors
from tests.render import brute_force

MATT = Material((0.6, 0.6, 0.6), specular=0.0)
BALL = brute_force.SphereScene((0.0, 0.5, 0.0), 0.5, MATT, Ground(0.0, (0.5, 0.5, 0.5), 20))
CAMERA = Camera(np.array([0.5, 2.0, 2.5]), np.array([0.0, 0.4, 0.0]), 0.7, (32, 24))
SCENE = Scene((sphere(BALL.centre, BALL.radius_m, MATT, 24),), BALL.ground)
EXACT = np.zeros((24, 32, 3), np.float32)
EVEN = Truth(np.ones((24, 32, 3), np.float32), EXACT, np.ones((24, 32), bool))


class Painter:
    """A way that paints everything in one shade, and counts what is asked of it."""

    def __init__(self, shade=1.0):
        self.shade, self.opened, self.closed, self.frames = shade, 0, 0, []

    @contextmanager
    def __call__(self, scene, camera):
        self.opened += 1
        yield self.draw
        self.closed += 1

    def draw(self, lights, environment_map, frame):
        self.frames.append((len(lights), frame))
        return np.full((24, 32, 4), self.shade, np.float32)


def case(truth=EVEN, scene=SCENE, environment_map=None):
    return chart.Case("s", "m", scene, CAMERA, environment_map or outdoors(8), lambda: truth)


def measured(way="a", count=4, ms=1.0, rmse=0.1, **others):
    return chart.Measurement("s", "m", way, count, count, ms, 0.0, rmse, 0.05, 0.01)
