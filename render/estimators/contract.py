"""What an estimator is: from surfaces that a picture shows, to the light they send to the eye.

An estimator is prepared once for the light and the scene. Then it is given surfaces, sixteen to a
packet, a number of samples and a seed, and adds an estimate of what each surface reflects of the
light that comes straight from the map. Another seed gives an independent estimate. Loops over
packets are compiled and parallel, their rays go to Embree in packets; none calls Python.

tests/render/test_estimator_contract.py states what each keeps to.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lighting.maps.environment import EnvironmentMap
from render.reference.surfaces import Tables

Floats = NDArray[np.float32]
Memory = dict[int, NDArray[np.float64]]
"""What an estimator learns of a scene from pass to pass, by the number of samples."""


class Shadows(NamedTuple):
    """What stands between surfaces and light.

    Attributes
    ----------
    function, scene : int
        Addresses of Embree's rtcOccluded16 and scene.
    sphere : (4,) float32
        Centre and radius of a sphere around the meshes: rays that miss it need no tracing.
    lowest : float
        From directions whose y is not above this no light comes.
    """

    function: int
    scene: int
    sphere: Floats
    lowest: float


class Setting(NamedTuple):
    """What an estimator is prepared for.

    Attributes
    ----------
    environment : EnvironmentMap
        All light; black where a ground keeps it off.
    shadows : Shadows
    scene : Tables
        What surfaces look like that rays may meet.
    bounces : int
        Surfaces that light may meet on its way to the eye; above 1 for `paths` alone.
    memory : dict or None
        Of the same setting, to go on from; it is added to. None to begin with none.
    """

    environment: EnvironmentMap
    shadows: Shadows
    scene: Tables
    bounces: int = 1
    memory: Memory | None = None


Estimate = Callable[[Floats, int, int, Floats], int]
"""estimate(surfaces, samples, seed, radiance): adds to `radiance`, returns how many rays it traced.

surfaces (P, FIELDS, 16) float32 are as `reference.surfaces.find_surfaces` sets them; radiance is
(P, 3, 16) float32, red, green, blue. Surfaces that are no hit get nothing. `samples` is the number
of directions that are drawn for each surface; not all of them need a ray.
"""

Prepare = Callable[[Setting], Estimate]
