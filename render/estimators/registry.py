"""The estimators by name: each a file of this folder."""

from collections.abc import Mapping
from functools import partial

from lighting.reduce import METHODS
from render.estimators.brdf_sampling import brdf, cosine
from render.estimators.contract import Prepare
from render.estimators.environment_sampling import inverse_cdf, strata
from render.estimators.fixed_lights import fixed_lights
from render.estimators.irradiance_cache import irradiance_cache
from render.estimators.multiple_importance import BALANCE, POWER, multiple_importance
from render.estimators.paths import paths
from render.estimators.points import hammersley, independent, net
from render.estimators.resampling import rejection, resampling
from render.estimators.shared_product import shared_product
from render.estimators.wavelet import wavelet

PATHS = "paths"
"""The only one that follows light from surface to surface."""

_UNBIASED: Mapping[str, Prepare] = {
    "cosine": cosine,
    "brdf": brdf,
    "inverse-cdf": inverse_cdf,
    "structured": partial(strata, "structured"),
    "kollig-keller": partial(strata, "kollig-keller"),
    "penrose": partial(strata, "penrose"),
    "mis-balance": partial(multiple_importance, heuristic=BALANCE),
    "mis-power": partial(multiple_importance, heuristic=POWER),
    "mis-compensated": partial(multiple_importance, is_compensated=True),
    "resampling-light": partial(resampling, by_light=True),
    "resampling-brdf": partial(resampling, by_light=False),
    "rejection-light": partial(rejection, by_light=True),
    "rejection-brdf": partial(rejection, by_light=False),
    "hierarchical": partial(wavelet, point_set=net, is_product=False),
    "wavelet": partial(wavelet, point_set=net),
    "wavelet-hammersley": partial(wavelet, point_set=hammersley),
    "wavelet-random": partial(wavelet, point_set=independent),
    "shared-product": shared_product,
    PATHS: paths,
}

_BIASED: Mapping[str, Prepare] = {
    "irradiance-cache": irradiance_cache,
    **{f"lights-{method}": partial(fixed_lights, method) for method in METHODS},
}

ESTIMATORS: Mapping[str, Prepare] = {**_UNBIASED, **_BIASED}

UNBIASED = frozenset(_UNBIASED)
"""Those whose passes have the truth as their mean: their spread is all of their error."""
