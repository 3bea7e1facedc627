"""From relative radiance to cd/m², by one measurement in the scene.

Input  : an EnvironmentMap in relative units and what a meter showed.    Output : cd/m² per unit.
A luminance meter's spot, a grey card (of which ρE/π is the luminance, ρ its reflectance and E the
illuminance on it) or an illuminance meter that faces a known way. The factor is the camera's: it
holds for other pictures of the same camera, lens and response.
Fails  : the camera's channels are not the eye's, so that a factor found under one lamp is off by
         several per cent under another; and glare in the lens is measured as light.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from capture.errors import InputError
from capture.radiance import CD_M2, RELATIVE
from lighting.maps.environment import EnvironmentMap, luminance
from lighting.photometry.disc import disc_shares
from lighting.photometry.illuminance import surface_illuminance, unit

_MOST_UNSEEN = 0.02
"""Of what an illuminance meter faces: as much as such meters err themselves."""


def scale_from_luminance(
    environment: EnvironmentMap, direction: ArrayLike, radius_rad: float, luminance_cd_m2: float
) -> tuple[float, float]:
    """Return cd/m² per unit of the map, and how uneven the spot was.

    Parameters
    ----------
    environment : EnvironmentMap
    direction : (3,) array_like
        Where the meter pointed, in the world frame.
    radius_rad : float
        Of the meter's spot. Cells count by how much of it lies in them.
    luminance_cd_m2 : float
        What it showed.

    Returns
    -------
    factor : float
    unevenness : float
        Standard deviation of the luminance over the spot and a cell beyond it, over the mean of
        the spot: what a slightly different aim, or a finer map, may change.

    Raises
    ------
    InputError
        If the map is absolute already, or the spot is clipped, unseen or black.
    """
    _check(environment, luminance_cd_m2, "a luminance")
    if not 0 <= radius_rad < np.pi / 2:
        raise InputError(f"a spot's radius is from 0° to 90°, got {np.degrees(radius_rad):.4g}°")
    height = environment.height
    towards = unit(direction)
    shares = disc_shares(height, towards, radius_rad)
    inside = shares > 0
    if not environment.valid[inside].all():
        raise InputError("the spot holds directions that the camera did not see; choose another")
    if environment.clipped[inside].any():
        raise InputError("the spot is clipped: how bright it is is not known; choose a darker one")
    seen = luminance(environment.radiance)
    mean = float((shares * seen).sum())
    if mean <= 0:
        raise InputError("the spot is black in the map; choose a brighter one")
    around = disc_shares(height, towards, radius_rad + np.pi / height) * environment.valid
    spread = float(np.sqrt(np.average((seen - mean) ** 2, weights=around)))
    return luminance_cd_m2 / mean, spread / mean


def grey_card_luminance(reflectance: float, illuminance_lx: float) -> float:
    """Return the luminance of a matt card in cd/m², ρE/π."""
    if not 0 < reflectance <= 1:
        raise InputError(f"a reflectance is from 0 to 1, as 0.18 of a grey card; got {reflectance}")
    if not (np.isfinite(illuminance_lx) and illuminance_lx > 0):
        raise InputError(f"an illuminance must be positive, got {illuminance_lx:g} lx")
    return reflectance * illuminance_lx / np.pi


def scale_from_illuminance(
    environment: EnvironmentMap,
    normal: ArrayLike,
    illuminance_lx: float,
    *,
    clipped_were_shaded: bool = False,
) -> float:
    """Return cd/m² per unit of the map from what a meter showed that faced `normal`.

    Parameters
    ----------
    environment : EnvironmentMap
    normal : (3,) array_like
        In the world frame: (0, 1, 0) of a meter that lies on the ground.
    illuminance_lx : float
    clipped_were_shaded : bool
        The meter stood in the shade of what is clipped in the map, which then counts for nothing.

    Raises
    ------
    InputError
        If the map is absolute already or black, the meter faced what the camera did not see, or
        what is clipped shone on the meter: how much light that was is not known.
    """
    _check(environment, illuminance_lx, "an illuminance")
    received = surface_illuminance(environment, normal)
    if received.unseen_share > _MOST_UNSEEN:
        raise InputError(
            f"the camera did not see {received.unseen_share:.1%} of what the meter faced; measure "
            "where the camera looks, or give a spot's luminance"
        )
    total = received.total
    if received.clipped_share > 0:
        if not clipped_were_shaded:
            raise InputError(
                f"clipped cells give {received.clipped_share:.1%} of the meter's light or more, "
                "and the scale would be too large: give a spot's luminance, or measure in their "
                "shade and say so, and recover their light with `fishlight recover`"
            )
        total *= 1 - received.clipped_share
    if total <= 0:
        raise InputError("the map is black where the meter faced")
    return illuminance_lx / total


def in_cd_m2(environment: EnvironmentMap, factor: float) -> EnvironmentMap:
    """Return the map in cd/m²: its radiance times `factor`, so that `luminance` of it is in cd/m².

    Raises
    ------
    InputError
        If the map is absolute already, or float32 cannot hold the result.
    """
    _check(environment, factor, "a scale")
    with np.errstate(over="ignore"):
        radiance = environment.radiance * np.float32(factor)
    if not np.isfinite(radiance).all():
        raise InputError(f"times {factor:g}, the map's radiance is beyond what its file can hold")
    return replace(environment, radiance=radiance, scale=CD_M2)


def _check(environment: EnvironmentMap, measured: float, what: str) -> None:
    if environment.scale != RELATIVE:
        raise InputError(f"the map is in {environment.scale} already")
    if not (np.isfinite(measured) and measured > 0):
        raise InputError(f"{what} must be positive and finite, got {measured:g}")
