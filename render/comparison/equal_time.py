"""Pictures of every estimator after the same time: what the gallery shows.

Input  : cases.    Output : pictures and what they err by.
Cost   : the time that is given, for each estimator and case.
Fails  : a busy machine gives some of them less.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from render.comparison.convergence import REFERENCE
from render.estimators.passes import estimate_picture
from render.estimators.registry import UNBIASED
from render.measures.chart import Case
from render.measures.picture_errors import relative_rmse
from render.reference.tracing import ReferencePicture, render_reference

_SMALL_PX = (16, 16)
_SEED = 1  # not that of the truth, whose first passes the reference would repeat


@dataclass(frozen=True, eq=False)
class Shown:
    """A picture of one estimator.

    Attributes
    ----------
    radiance : (H, W, 4) float32
    rmse : float
        Relative, against the truth.
    told : float
        What the picture itself says that it errs by: the relative error of its passes.
    passes, rays : int
    """

    estimator: str
    radiance: NDArray[np.float32]
    rmse: float
    told: float
    passes: int
    rays: int


def truest(shown: Iterable[Shown]) -> Shown:
    """Return the picture that errs least of those whose error is noise: it falls with time."""
    converging = UNBIASED | {REFERENCE}
    return min((each for each in shown if each.estimator in converging), key=lambda s: s.rmse)


def pictures(case: Case, names: Sequence[str], seconds: float) -> Iterator[Shown]:
    """Yield what each estimator makes of a case within the time, but at least four passes."""
    small = replace(case, camera=replace(case.camera, size_px=_SMALL_PX))
    for name in names:
        _drawn(small, name, 0.0)  # compiles
        picture = _drawn(case, name, seconds)
        yield Shown(
            name,
            picture.radiance,
            relative_rmse(picture.radiance, case.truth()),
            picture.relative_error,
            picture.passes,
            picture.shadow_rays,
        )


def _drawn(case: Case, name: str, seconds: float) -> ReferencePicture:
    view = case.scene, case.camera, case.environment
    if name == REFERENCE:
        return render_reference(*view, error=0.0, seconds=seconds, seed=_SEED)
    return estimate_picture(name, *view, error=0.0, seconds=seconds, seed=_SEED)
