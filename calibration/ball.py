"""The calibration of a mirror ball, from its outline in a picture.

Input  : Outline, and the camera's focal length or how far off it was.    Output : BallFit.
Where a pixel looks depends on where the ball is in the picture and on D/R, the distance of its
centre over its radius. The size of the outline tells D/R if the focal length is known.
Fails  : for things near the ball, which it sees from its surface: a thing at the distance d appears
up to R/d rad beside its place.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calibration.ball_cone import Pinhole
from calibration.ball_outline import Outline
from calibration.camera import LEVEL, Calibration, yaw_rotation
from calibration.models.mirror_ball import MirrorBall
from calibration.models.mirror_ball_off_axis import MirrorBallOffAxis
from calibration.reflectance import straight_reflectance
from calibration.sharpness import pixels_per_rad
from capture.errors import InputError
from capture.radiance import RadianceImage

Array = NDArray[np.float64]

ASSUMED_RATIO = (20.0, 10.0)
"""D/R where nothing tells it, and by how much less it may be: a ball of 10 cm from 1 m, or from
0.5 m, or from anywhere farther off, which makes as little difference."""
_WIDEST_PX_RAD = np.radians(5.0)
"""Angle across one pixel at which the stretched rim ends being a measurement."""
_LARGEST_DEVIATION_RAD = np.radians(20.0)
"""Standard deviation of a direction at which it does so: only of balls that were marked by hand."""
_AZIMUTHS = 8
_ANGLES = 720


@dataclass(frozen=True, eq=False)
class BallFit:
    """A calibrated ball, and how well it is known.

    Attributes
    ----------
    calibration : Calibration
        Valid up to where a pixel spans 5°, or its direction is uncertain by 20°.
    angles_rad, deviation_rad : (A,) float64
        Angles from the direction back to the camera, and the standard deviation of directions
        there: what outline and D/R leave open, in the worst of eight azimuths.
    outline : Outline
    """

    calibration: Calibration
    angles_rad: Array
    deviation_rad: Array
    outline: Outline

    @property
    def distance_ratio(self) -> float:
        """Distance of the ball's centre over its radius."""
        return float(getattr(self.calibration.model, "distance_ratio"))  # noqa: B009


def fit_ball(
    outline: Outline,
    size_px: tuple[int, int],
    pinhole: Pinhole,
    distance_ratio: tuple[float, float] | None = None,
    R_world_camera: Array = LEVEL,
) -> BallFit:
    """Return the calibration of a ball with a known outline.

    Parameters
    ----------
    outline
        From `find_outline` with the same pinhole.
    size_px
        (width, height) of the picture.
    pinhole
        The camera, or `distant_pinhole`, which tells no distance.
    distance_ratio
        D/R and its standard deviation, toward the ball, where the pinhole does not tell it; the
        outline is then taken for a circle about the camera's axis. None to take it from the
        outline.
    R_world_camera
        How the camera stood.

    Raises
    ------
    InputError
        If the distance ratio less its deviation is not above 1.
    """
    cone = np.append(outline.centre_px, outline.half_angle_rad)
    factor = np.linalg.cholesky(outline.covariance)
    ratio, ratio_deviation = (None, 0.0) if distance_ratio is None else distance_ratio
    model = _model(pinhole, cone, ratio)
    azimuth = 2 * np.pi * np.arange(_AZIMUTHS) / _AZIMUTHS
    angles = np.linspace(0.0, model.limit_angle_rad, _ANGLES, endpoint=False)[1:]
    sine, cosine = np.sin(angles)[:, None], np.cos(angles)[:, None]
    directions = np.stack(
        [sine * np.cos(azimuth), sine * np.sin(azimuth), -cosine + 0 * azimuth], axis=-1
    )
    pixels, _ = model.project(directions)
    changed = [_model(pinhole, cone + step, ratio) for step in factor.T]
    if ratio is not None:
        # A nearer ball differs more than one that is farther by as much.
        changed.append(_model(pinhole, cone, ratio - ratio_deviation))
    squares = np.zeros(pixels.shape[:-1])
    for other in changed:
        moved, _ = other.unproject(pixels)
        # The frames differ by how the camera has to turn to look at the ball.
        moved = moved @ (_camera_ball(model).T @ _camera_ball(other)).T
        squares += np.sum((moved - directions) ** 2, axis=-1)
    deviation = np.sqrt(np.nan_to_num(squares, nan=np.pi**2).max(axis=1))
    sharp = (pixels_per_rad(model, directions) * _WIDEST_PX_RAD >= 1).all(axis=1)
    known = sharp & (deviation <= _LARGEST_DEVIATION_RAD)
    end = len(angles) if known.all() else max(int(np.argmin(known)), 1)
    angles, deviation = angles[:end], deviation[:end]
    calibration = Calibration(
        model, size_px, float(angles[-1]), R_world_camera @ _camera_ball(model)
    )
    return BallFit(calibration, angles, deviation, outline)


def measure_reflectance(
    image: RadianceImage, calibration: Calibration, direct_px: Array, mirrored_px: Array
) -> tuple[float, float, float]:
    """Return the ball's reflectance from a thing that a picture shows twice.

    Parameters
    ----------
    image
        The picture of the ball, linear.
    calibration
        Of the ball in it.
    direct_px, mirrored_px : (2,) float64
        Where the thing is seen past the ball and in it. It has to be matt, for the ball sees it
        from another side, and to cover 5 × 5 pixels about both.

    Raises
    ------
    InputError
        If pixels there are clipped, outside or black, or the ratio is no metal's.
    """
    seen = []
    for name, (x, y) in (("the thing itself", direct_px), ("its reflection", mirrored_px)):
        rows, columns = slice(round(y) - 2, round(y) + 3), slice(round(x) - 2, round(x) + 3)
        is_within = min(rows.start, columns.start) >= 0
        good = (image.valid & ~image.clipped)[rows, columns] if is_within else np.zeros((0, 0))
        if good.shape != (5, 5) or not good.all():
            raise InputError(f"{name} at {x:g},{y:g} is clipped, or at the picture's edge")
        seen.append(np.median(image.radiance[rows, columns].reshape(-1, 3), axis=0))
        if not np.all(seen[-1] > 0):
            raise InputError(f"{name} at {x:g},{y:g} is black in a channel")
    direction, is_seen = calibration.unproject(mirrored_px)
    if not is_seen:
        raise InputError(f"{mirrored_px[0]:g},{mirrored_px[1]:g} is not in the ball")
    incidence_rad = float(calibration.incidence_rad(direction))
    red, green, blue = straight_reflectance(seen[1] / seen[0], incidence_rad).tolist()
    return red, green, blue


def pose(yaw_rad: float, pitch_rad: float, roll_rad: float) -> Array:
    """Return R_world_camera of a camera at the ball.

    Level and looking along +Z, it is rolled clockwise, as seen from behind it, then pitched up,
    then turned to the left as seen from above: toward +X.
    """
    cosine, sine = np.cos(pitch_rad), np.sin(pitch_rad)
    pitch = np.array([[1, 0, 0], [0, cosine, sine], [0, -sine, cosine]])
    cosine, sine = np.cos(roll_rad), np.sin(roll_rad)
    roll = np.array([[cosine, -sine, 0], [sine, cosine, 0], [0, 0, 1]])
    return yaw_rotation(yaw_rad) @ pitch @ LEVEL @ roll


def _model(pinhole: Pinhole, cone: Array, ratio: float | None) -> MirrorBall | MirrorBallOffAxis:
    centre = (float(cone[0]), float(cone[1]))
    if ratio is not None:
        return MirrorBall(centre, float(pinhole.focal_px * np.tan(cone[2])), ratio)
    return MirrorBallOffAxis(
        centre, pinhole.principal_px, pinhole.focal_px, float(1.0 / np.sin(cone[2]))
    )


def _camera_ball(model: MirrorBall | MirrorBallOffAxis) -> Array:
    return model.R_camera_ball if isinstance(model, MirrorBallOffAxis) else np.eye(3)
