"""Several live sessions as one: their lights blended by where each camera stands.

Each source has a session and a thread of its own, without pictures, under the settings of the
blend; here what they saw last is blended, drawn and published. A source that is away, or missing
from the start, has no weight: it fades out while the others take its share, and in when it is back.
With all of them away the last blend stays, and is stale.

Input  : what to run where, and a Desk.    Output : what the desk publishes, and Counters.
Fails  : moments are not interpolated: a camera that is slower shows older light.
"""

import time
from collections import deque
from collections.abc import Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from functools import partial
from pathlib import Path
from threading import Event
from typing import Any

import numba
import numpy as np
from numpy.typing import NDArray

from capture.errors import InputError
from lighting.light_set import LightSet
from lighting.maps.environment import EnvironmentMap, luminance
from lighting.stream.blending import blend_lights, blend_maps, followed_weights, place_weights
from render.live.blend_parts import (
    Part,
    PlacedSource,
    common_account,
    common_state,
    pass_on_notices,
)
from render.live.desk import Desk, Seen, State
from render.live.exposing import ViewExposure
from render.live.picture import LivePicture
from render.live.running import Missing, Stop, run_live
from render.live.saving import Say, answer, save
from render.session import Counters

_TICK_S = 0.05
"""Between the steps of a fade, while no source has news."""

_FRAMES = 30
"""Over which the frame rate is taken."""


class Blend:
    """Sessions of several sources under one desk.

    Parameters
    ----------
    sources : sequence of PlacedSource
    desk : Desk
    picture : LivePicture or None
        None draws nothing.
    output : Path
        Folder for what is saved of the blend.
    say : callable

    Raises
    ------
    InputError
        If numba has no threads that several threads may enter.
    """

    def __init__(
        self,
        sources: Sequence[PlacedSource],
        desk: Desk,
        picture: LivePicture | None,
        output: Path,
        say: Say,
    ) -> None:
        _require_safe_threads()
        self._desk = desk
        self._picture = picture
        self._output = output
        self._say = say
        self._parts = [Part(source, Desk(desk.settings, desk.models)) for source in sources]
        self._news = Event()
        self._weights: NDArray[np.float64] | None = None
        self._weighed_s = 0.0
        self._time_s = 0.0
        self._exposure = ViewExposure()
        self._published_s: deque[float] = deque(maxlen=_FRAMES)
        self._drawn_ms = 0.0

    def run(self, stop: Stop, *, is_patient: bool) -> Counters:
        """Blend until `stop` is set or every source has ended; return what all counted together.

        Parameters
        ----------
        stop : Stop
        is_patient : bool
            Whether to wait for a source that is missing from the start; one that was there and is
            lost is always waited for.

        Raises
        ------
        FishlightError
            If a source is missing and `is_patient` is not set, or scales differ.
        """
        self._desk.on_change = self._pass_on
        self._pass_on()
        with (
            ThreadPoolExecutor(len(self._parts), "fishlight-source") as threads,
            ThreadPoolExecutor(1, "fishlight-results") as writer,
        ):
            running = [threads.submit(self._run_part, part, is_patient) for part in self._parts]
            try:
                self._follow(running, stop, writer)
            finally:
                for part in self._parts:
                    part.stop.set()
        self._look()
        pass_on_notices(self._parts, self._desk)
        total = sum((future.result() for future in running), Counters())
        self._publish(State("ended", "The session has ended."))
        return total

    def _run_part(self, part: Part, is_patient: bool) -> Counters:
        part.desk.listen(self._news.set)
        run = partial(run_live, part.source.request, part.desk, None, part.stop, say=self._say)
        try:
            return run(is_patient=is_patient)
        except Missing as missing:
            if part.desk.last_seen()[0] is None:
                raise
            return missing.counters + run(is_patient=True)
        finally:
            self._news.set()

    def _follow(
        self, running: Sequence[Future[Counters]], stop: Stop, writer: ThreadPoolExecutor
    ) -> None:
        """Publish what is new until the end."""
        while not stop.is_set and not all(future.done() for future in running):
            is_new = self._news.wait(_TICK_S)
            self._news.clear()
            for future in running:
                if future.done():
                    future.result()
            self._look()
            if is_new or self._is_fading():
                pass_on_notices(self._parts, self._desk)
                seen = self._publish(common_state(self._parts))
                if seen is not None:
                    self._do_requests(writer, seen)

    def _look(self) -> None:
        for part in self._parts:
            part.look()

    def _pass_on(self) -> None:
        """Have every source follow the settings of the blend."""
        for part in self._parts:
            part.desk.settings = self._desk.settings
            part.desk.watchers = self._desk.watchers
            part.desk.on_change()
        self._news.set()

    def _wanted(self) -> NDArray[np.float64] | None:
        """Return the weights of those that see; None if there are none."""
        seeing = [part.is_seeing for part in self._parts]
        if not any(seeing):
            return None
        settings = self._desk.settings
        places = [part.source.place_m for part in self._parts if part.is_seeing]
        weights = np.zeros(len(self._parts))
        weights[seeing] = place_weights(places, (settings.x_m, settings.y_m, settings.z_m))
        return weights

    def _is_fading(self) -> bool:
        wanted, shown = self._wanted(), self._weights
        return wanted is not None and (shown is None or not np.array_equal(wanted, shown))

    def _weigh(self) -> NDArray[np.float64] | None:
        wanted, now_s = self._wanted(), time.monotonic()
        if wanted is not None:
            shown = wanted if self._weights is None else self._weights
            self._weights = followed_weights(shown, wanted, now_s - self._weighed_s)
        self._weighed_s = now_s
        return self._weights

    def _publish(self, state: State) -> Seen | None:
        weights = self._weigh()
        if weights is None:
            self._desk.publish(state, None, 0.0, self._account(None, None))
            return None
        lights = self._lights(weights)
        environment = self._environment(weights)
        picture = self._drawn(lights, environment)
        strongest = self._parts[int(weights.argmax())].moment.seen
        assert strongest is not None
        assert strongest.camera is not None
        shown = strongest.camera
        view_ev = self._exposure.next_ev(
            self._desk.settings.view_ev,
            picture,
            luminance(shown.radiance[shown.valid]).astype(np.float32),
        )
        is_draft = self._picture is not None and self._picture.is_draft
        seen = Seen(lights, shown, environment, picture, view_ev, is_draft)
        now_s = time.monotonic()
        age_s = min(
            part.age_s(now_s)
            for part, weight in zip(self._parts, weights, strict=True)
            if weight > 0
        )
        self._published_s.append(now_s)
        self._desk.publish(state, seen, age_s, self._account(weights, age_s))
        return seen

    def _lights(self, weights: NDArray[np.float64]) -> LightSet:
        sets = [part.lights for part in self._parts]
        kept = [(each, weight) for each, weight in zip(sets, weights, strict=True) if weight > 0]
        # It never falls, whoever fades out.
        self._time_s = max(self._time_s, *(each.timestamp_s for each, _ in kept))
        source = " + ".join(f"{weight:.2f} × ({each.source})" for each, weight in kept)
        return blend_lights(sets, weights, timestamp_s=self._time_s, source=source)

    def _environment(self, weights: NDArray[np.float64]) -> EnvironmentMap | None:
        """Return the blended map; None where a source with weight made none, being unwatched."""
        kept = [
            (part.moment.seen, weight)
            for part, weight in zip(self._parts, weights, strict=True)
            if weight > 0
        ]
        maps = [seen.environment for seen, _ in kept if seen is not None and seen.environment]
        if not self._desk.is_watched or len(maps) < len(kept):
            return None
        return blend_maps(maps, [weight for _, weight in kept])

    def _drawn(
        self, lights: LightSet, environment: EnvironmentMap | None
    ) -> NDArray[np.float32] | None:
        if self._picture is None or environment is None:
            return None
        settings, start_s = self._desk.settings, time.perf_counter()
        picture = self._picture.render(
            settings, lights, environment if settings.is_background else None
        )
        self._drawn_ms = 1e3 * (time.perf_counter() - start_s)
        return picture

    def _do_requests(self, writer: ThreadPoolExecutor, seen: Seen) -> None:
        """Save what was asked for; recordings are made by each source, in its own folder."""
        for request in self._desk.requests():
            save_it = partial(save, self._output, request, seen)
            do = self._record if request == "record" else save_it
            writer.submit(answer, self._desk, self._say, request, do)

    def _record(self) -> str:
        seeing = [part for part in self._parts if part.is_seeing]
        for part in seeing:
            part.desk.ask("record")
        return f"Each source that sees records by itself: {', '.join(p.name for p in seeing)}"

    def _account(self, weights: NDArray[np.float64] | None, age_s: float | None) -> dict[str, Any]:
        shown = [0.0] * len(self._parts) if weights is None else weights.tolist()
        account = common_account(self._parts, shown, time.monotonic())
        times_s = self._published_s
        elapsed_s = times_s[-1] - times_s[0] if len(times_s) > 1 else 0.0
        return account | {
            "times_ms": {**account["times_ms"], "render": round(self._drawn_ms, 2)},
            "frame_rate_hz": round((len(times_s) - 1) / elapsed_s, 1) if elapsed_s else None,
            "latency_ms": None if age_s is None else round(1e3 * age_s, 1),
        }


def _require_safe_threads() -> None:
    """Have numba choose threads that several threads may enter."""
    numba.config.THREADING_LAYER = "threadsafe"  # type: ignore[attr-defined]
    try:
        numba.get_num_threads()
    except ValueError:
        raise InputError(
            "--blend: numba found no threads that several sessions may share; pip install tbb"
        ) from None
