"""The exposures of a live camera: as they were asked for, or chosen anew from bracket to bracket.

Input  : a camera, and each bracket that it gave.    Output : the times of the next one.
"""

from collections.abc import Sequence

from capture.errors import InputError
from capture.exposure_plan import first_plan, next_plan, possible_times, usable_light
from capture.frame import Bracket
from capture.mains import MainsWatch
from capture.scene_range import scene_range
from capture.v4l2.camera import BracketCamera

_TOLERANCE = 0.1
"""Relative difference between the time asked for and the nearest that the camera can do: 0.14 EV,
which the label tells and nobody sees."""


class ExposureChooser:
    """Chooses a camera's exposures for the scene, or keeps to those that were asked for.

    Attributes
    ----------
    is_fixed : bool
        Whether they were asked for.
    times_s : tuple of float
        Exposure times of the next bracket.
    """

    def __init__(
        self,
        camera: BracketCamera,
        exposures_s: Sequence[float] | None = None,
        mains_hz: float | None = None,
    ) -> None:
        """Start with the exposures asked for, or with a probe of all that the camera can do.

        Parameters
        ----------
        camera : BracketCamera
        exposures_s : sequence of float or None
            None chooses them.
        mains_hz : float or None
            Frequency of the mains that feed the lamps; 0 if none do, None to find out from the
            pixels. Not used with `exposures_s`.

        Raises
        ------
        InputError
            If the camera cannot do `exposures_s`, or is too noisy to choose them.
        """
        self.is_fixed = exposures_s is not None
        self._range_s, self._step_s = camera.exposure_range_s, camera.exposure_step_s
        self._mains_hz = mains_hz
        self._watch = MainsWatch()
        if exposures_s is not None:
            self.times_s = checked_times(camera, exposures_s)
        else:
            possible_s = possible_times(self._range_s, self._step_s, mains_hz or 0.0)
            self._plan = first_plan(usable_light(camera.sensor), possible_s)
            self.times_s = self._plan.times_s

    def look_at(self, bracket: Bracket, camera: BracketCamera) -> None:
        """Choose the next exposures by a bracket; without effect if they were asked for."""
        if self.is_fixed:
            return
        mains_hz = self._mains_hz
        if mains_hz is None:
            mains_hz = self._watch.look_at(bracket, camera.sensor)
        self._plan = next_plan(
            self._plan,
            scene_range(bracket, camera.sensor),
            usable_light(camera.sensor),
            possible_times(self._range_s, self._step_s, mains_hz),
        )
        self.times_s = self._plan.times_s


def checked_times(camera: BracketCamera, times_s: Sequence[float]) -> tuple[float, ...]:
    """Return the times that the camera does for those asked for, in their order.

    Raises
    ------
    InputError
        If one is off by more than a tenth, or two become the same.
    """
    nearest_s = tuple(camera.nearest_exposure(time_s) for time_s in times_s)
    for time_s, near_s in zip(times_s, nearest_s, strict=True):
        if not abs(near_s - time_s) <= _TOLERANCE * time_s:
            shortest_s, longest_s = camera.exposure_range_s
            raise InputError(
                f"--exposures: {camera.name} cannot expose for {time_s:g} s, the nearest is "
                f"{near_s:g} s; it goes from {shortest_s:g} to {longest_s:g} s at this frame rate, "
                f"in steps of {camera.exposure_step_s:g} s"
            )
    if len(set(nearest_s)) < len(nearest_s):
        listed = ", ".join(f"{time_s:g}" for time_s in nearest_s)
        raise InputError(f"--exposures: {camera.name} would make {listed} s of them, some twice")
    return nearest_s
