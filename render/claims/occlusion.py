"""Ambient occlusion over the width of its cone and the distance up to which things count.

Input  : the default scene.    Output : mean openness, pictures.
Cost   : half a second for each picture.
"""

import math

import numpy as np
from numpy.typing import NDArray

from render.claims.contract import Claim, Finding, Maps
from render.reference.ambient_occlusion import ambient_occlusion
from render.scenes.default_scene import default_scene

CONES_DEG = (180.0, 90.0, 45.0)
DISTANCES_M = (0.25, 1.0, math.inf)
SIZE_PX = (240, 180)

_MEAN = "mean occlusion"

Floats = NDArray[np.float32]


def occlusion_grid() -> dict[tuple[float, float], Floats]:
    """Return openness and coverage (H, W, 2) of the default scene by cone in degrees, distance."""
    scene, camera = default_scene(SIZE_PX)
    return {
        (cone, distance): ambient_occlusion(scene, camera, math.radians(cone), distance)
        for cone in CONES_DEG
        for distance in DISTANCES_M
    }


def _over_cone_and_distance(_maps: Maps) -> list[Finding]:
    findings: list[Finding] = []
    grid = occlusion_grid()
    narrower = [0.0] * len(DISTANCES_M)
    for cone in reversed(CONES_DEG):
        shorter = 0.0
        for k, distance in enumerate(DISTANCES_M):
            seen = grid[cone, distance]
            openness = seen[seen[..., 1] > 0, 0]
            closed = 1 - float(openness.mean())
            figures = {
                _MEAN: closed,
                "share of pixels more than half closed": float(np.mean(openness < 0.5)),
            }
            reach = "any distance" if math.isinf(distance) else f"up to {distance:g} m"
            # The first has nothing to be held against.
            holds = closed >= max(shorter, narrower[k]) if findings else None
            findings.append(Finding(f"cone {cone:g}°, {reach}", figures, holds))
            shorter = narrower[k] = closed
    return findings


OCCLUSION = Claim(
    "ambient occlusion over cone and distance",
    "A = 1 − hits / rays darkens corners, and less so with a narrower cone or a shorter reach.",
    "Zhukov, Iones, Kronin, Eurographics Workshop on Rendering 1998; production practice since",
    "Mean occlusion of the default scene. Holds where it is no smaller than with the next shorter "
    "reach and the next narrower cone.",
    _over_cone_and_distance,
    _MEAN,
)
