"""Simulated scenes of tests/benchmarks/lens.py: lenses that are known, and boards before them."""

from typing import NamedTuple

import numpy as np

from calibration.board import Board
from calibration.camera import CameraModel
from calibration.models.double_sphere import DoubleSphere
from calibration.models.kannala_brandt import KannalaBrandt
from calibration.observations import View
from tests.calibration.simulated_views import BOARD, simulated_views

SIZE_PX = (1200, 1200)

NOISE_PX = 0.1


class Scene(NamedTuple):
    """A lens that is known, and the board that is shown it up to an angle from the axis."""

    lens: CameraModel
    board: Board
    rim_rad: float

    def views(self, count: int, seed: int) -> list[View]:
        """Return views at places drawn by the seed."""
        random, angle = np.random.default_rng(seed), self.rim_rad
        return simulated_views(
            self.lens,
            SIZE_PX,
            count,
            random,
            board=self.board,
            noise_px=NOISE_PX,
            most_angle_rad=angle,
        )


_WIDE = KannalaBrandt((601.3, 597.2), 330.0, -0.02, 0.004, -0.001, 0.0)

SIMULATED = {
    "194°": Scene(_WIDE, BOARD, np.deg2rad(80.0)),
    "220°": Scene(DoubleSphere((595.1, 603.8), 250.0, -0.15, 0.6), BOARD, np.deg2rad(80.0)),
    "194°, large board": Scene(_WIDE, Board("checkerboard", 8, 6, 0.05), np.deg2rad(97.0)),
}
