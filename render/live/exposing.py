"""The exposure at which a session shows its pictures: asked for, or slowly adapting."""

import numpy as np
from numpy.typing import NDArray

from render.output.view import auto_exposure_ev, exposure_of

_ADAPTS = 0.1
"""Share of the way to the right exposure that each frame goes; a first frame goes all of it."""


class ViewExposure:
    """Follows what is shown, so that a change of light is seen before it is made up for."""

    def __init__(self) -> None:
        self._ev: float | None = None

    def next_ev(
        self,
        asked_ev: float | None,
        picture: NDArray[np.float32] | None,
        seen: NDArray[np.float32],
    ) -> float:
        """Return the exposure of the next frame.

        Parameters
        ----------
        asked_ev : float or None
        picture : (H, W, 4) float32 or None
            Rendered; what is in it decides.
        seen : (n,) float32
            Luminances that decide where there is none.
        """
        if asked_ev is not None:
            return asked_ev
        ev = exposure_of(seen) if picture is None else auto_exposure_ev(picture)
        self._ev = ev if self._ev is None else self._ev + _ADAPTS * (ev - self._ev)
        return self._ev
