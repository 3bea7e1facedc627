"""Claims about how directions are drawn: by products of light and BRDF, and by resampling.

Input  : maps; the default scene in a small picture.
Output : how far estimates spread, and what they cost in rays and time.
Cost   : half a minute for each map.
"""

import math
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace

import numpy as np
from numba import njit
from numpy.typing import NDArray

from lighting.maps.environment import EnvironmentMap
from render.claims.contract import Claim, Finding, Maps, over
from render.estimators.contract import Setting, Shadows
from render.estimators.registry import ESTIMATORS
from render.rays.background import picture_rays
from render.rays.embree import (
    PACKET,
    Occluders,
    hit_packet,
    intersect16_address,
    occluded16_address,
)
from render.reference.surfaces import FIELDS, HIT, Tables, find_surfaces, scene_tables
from render.scenes.default_scene import default_scene

SIZE_PX = (48, 32)
FEW, MANY = 64, 512
CANDIDATES = 64

_FEW_OVER_MANY = f"error of {FEW} Hammersley over {MANY} random"
_AT_EQUAL_RAYS = "error at equal rays over drawn by light"
_ESTIMATES = 6
_BY_LIGHT = "inverse-cdf"
_RESAMPLED = ("rejection-light", "rejection-brdf", "resampling-light", "resampling-brdf")

Array = NDArray[np.float64]
Floats = NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class Spread:
    """What estimates of the same surfaces have shown.

    Attributes
    ----------
    mean : (P, 3, 16) float64
        Of the estimates.
    error : float
        Root mean square over surfaces of the standard deviation of an estimate.
    rays, candidates : float
        Traced for an estimate of all surfaces, and directions drawn.
    cpu_s : float
        Of all threads, for such an estimate.
    """

    mean: Array
    error: float
    rays: float
    candidates: float
    cpu_s: float

    @property
    def size(self) -> float:
        """Root mean square of the mean: what errors are relative to."""
        return math.sqrt(np.mean(self.mean**2))


def spreads(environment: EnvironmentMap, wanted: Sequence[tuple[str, int]]) -> list[Spread]:
    """Return what estimators with numbers of samples show of the surfaces of the default scene."""
    upper = environment.radiance.copy()
    upper[(environment.height + 1) // 2 :] = 0.0  # the ground keeps it off
    with _surfaces() as (surfaces, shadows, tables):
        setting = Setting(replace(environment, radiance=upper), shadows, tables)
        return [_spread(name, setting, surfaces, samples) for name, samples in wanted]


def _spread(name: str, setting: Setting, surfaces: Floats, samples: int) -> Spread:
    estimate = ESTIMATORS[name](setting)
    seen = np.zeros((_ESTIMATES, len(surfaces), 3, PACKET), np.float32)
    estimate(surfaces, samples, _ESTIMATES, seen[0])  # compiles
    seen[0] = 0
    start = time.process_time()
    rays = sum(estimate(surfaces, samples, seed, seen[seed]) for seed in range(_ESTIMATES))
    cpu_s = (time.process_time() - start) / _ESTIMATES
    error = math.sqrt(seen.var(axis=0, ddof=1, dtype=np.float64).mean())
    candidates = samples * float(surfaces[:, HIT].sum())
    mean = seen.mean(axis=0, dtype=np.float64)
    return Spread(mean, error, rays / _ESTIMATES, candidates, cpu_s)


@contextmanager
def _surfaces() -> Iterator[tuple[Floats, Shadows, Tables]]:
    """Give the surfaces (P, FIELDS, 16) at the middles of pixels, and what keeps light off them."""
    scene, camera = default_scene(SIZE_PX)
    tables = scene_tables(scene)
    rays = picture_rays(camera, SIZE_PX).reshape(-1, PACKET, 3).transpose(0, 2, 1)
    surfaces = np.empty((len(rays), FIELDS, PACKET), np.float32)
    eye = camera.eye.astype(np.float32)
    with Occluders(tables.positions, tables.faces) as occluders:
        toward = np.ascontiguousarray(rays, np.float32)
        _see(intersect16_address(), occluders.address, tables, eye, toward, surfaces)
        shadows = Shadows(occluded16_address(), occluders.address, tables.sphere, 0.0)
        yield surfaces, shadows, tables


@njit(cache=True, nogil=True)
def _see(
    function: int, scene: int, tables: Tables, eye: Floats, toward: Floats, surfaces: Floats
) -> None:  # pragma: no cover - compiled
    for k in range(len(toward)):
        hits, valid = hit_packet()
        valid[:] = -1
        for i in range(PACKET):
            for axis in range(3):
                hits[axis, i] = eye[axis]
                hits[4 + axis, i] = toward[k, axis, i]
        find_surfaces(function, scene, tables, hits, valid, surfaces[k])


def _hammersley_against_random(maps: Maps) -> list[Finding]:
    findings = []
    for name, environment in maps.items():
        wanted = (("wavelet-hammersley", FEW), ("wavelet-random", FEW), ("wavelet-random", MANY))
        found = spreads(environment, wanted)
        few, few_random, many_random = (each.error / found[-1].size for each in found)
        figures = {
            f"error of {FEW} Hammersley": few,
            f"error of {FEW} random": few_random,
            f"error of {MANY} random": many_random,
            _FEW_OVER_MANY: over(few, many_random),
        }
        findings.append(Finding(name, figures, few <= many_random))
    return findings


def _cost_of_resampling(maps: Maps) -> list[Finding]:
    findings = []
    for name, environment in maps.items():
        wanted = [(estimator, CANDIDATES) for estimator in (_BY_LIGHT, *_RESAMPLED)]
        plain, *resampled = spreads(environment, wanted)
        for estimator, found in zip(_RESAMPLED, resampled, strict=True):
            figures = {
                "candidates for each ray": found.candidates / found.rays,
                "µs of CPU for each ray": 1e6 * found.cpu_s / found.rays,
                "µs, drawn by light": 1e6 * plain.cpu_s / plain.rays,
                _AT_EQUAL_RAYS: _at_equal_rays(found, plain),
                "error at equal time over drawn by light": found.error
                / plain.error
                * math.sqrt(found.cpu_s / plain.cpu_s),
            }
            findings.append(Finding(f"{name}, {estimator}", figures, _is_worth(found, plain)))
    return findings


def _is_worth(found: Spread, plain: Spread) -> bool | None:
    """Return whether kept rays are few and worth more; None where too few are to tell."""
    if found.candidates > CANDIDATES * found.rays:
        return None
    return found.candidates > 2 * found.rays and _at_equal_rays(found, plain) < 1


def _at_equal_rays(found: Spread, plain: Spread) -> float:
    return found.error / plain.error * math.sqrt(found.rays / plain.rays)


WAVELET = Claim(
    "Hammersley points through the wavelet warp",
    f"{FEW} Hammersley points, warped by the product of map and BRDF, have less variance than "
    f"{MANY} random ones.",
    "Clarberg, Jarosz, Akenine-Möller, Jensen, SIGGRAPH 2005",
    "Standard deviation of estimates of the default scene's surfaces, with shadows, points moved "
    f"at random for each. Holds where {FEW} Hammersley points have no more than {MANY} random.",
    _hammersley_against_random,
    _FEW_OVER_MANY,
)
RESAMPLING = Claim(
    "what sample and resample costs",
    "Most candidates are thrown away, which makes each that is kept expensive; kept ones, the only "
    "ones with a ray, are worth more than as many drawn by light alone.",
    "Burke, Ghosh, Heidrich, EGSR 2005; Talbot, Cline, Egbert, EGSR 2005",
    f"{CANDIDATES} candidates for each surface of the default scene. Holds where more than half "
    f"are thrown away and the error at equal rays is below that of directions drawn by light; "
    f"nothing is said where less than one of a surface's is kept: the error of so few is chance.",
    _cost_of_resampling,
    _AT_EQUAL_RAYS,
)
