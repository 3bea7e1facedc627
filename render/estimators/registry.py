"""The estimators by name: each a file of this folder."""

from collections.abc import Mapping

from render.estimators.brdf_sampling import brdf, cosine
from render.estimators.contract import Prepare

ESTIMATORS: Mapping[str, Prepare] = {
    "cosine": cosine,
    "brdf": brdf,
}

UNBIASED = frozenset({"cosine", "brdf"})
"""Those whose passes have the truth as their mean: their spread is all of their error."""
