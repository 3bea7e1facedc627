"""A live session: brackets come, lights and pictures go out, and settings change between two.

Input  : a source of brackets, the calibration of its camera and a Desk.
Output : what the desk publishes after every bracket, and Counters at the end.
Cost   : where nobody watches, and the method takes block sums, no map is made and nothing drawn.
Fails  : a way from pictures to blocks is built when a method or count first needs it, which takes a
         fifth of a second for 448 × 448 pixels.
"""

import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from calibration.camera import Calibration
from capture.errors import InputError, UnreadableFrame
from capture.frame import Bracket
from capture.live_source import LiveSource
from capture.merge import merge_bracket
from capture.picture_memory import PictureMemory
from capture.radiance import RadianceImage
from capture.reopening import CameraAway
from lighting.blocks.block_sums import BlockSums
from lighting.blocks.source_blocks import SourceBlocks, apply_source_blocks, build_source_blocks
from lighting.light_set import LightSet
from lighting.maps.environment import EnvironmentMap, luminance
from lighting.maps.remap import apply_remap, build_remap
from lighting.reduce import BLOCK_METHODS
from lighting.stream.light_stream import LightPlan, StreamMemory, next_lights
from render.frame_rate import FrameRate
from render.live.camera_view import seen_pixels, state_of, thinned
from render.live.desk import Desk, Seen, State
from render.live.exposing import ViewExposure
from render.live.picture import LivePicture
from render.live.settings import Settings, light_plan
from render.live.sources import Source
from render.live.turning import turned_lights, turned_map
from render.session import Counters, Policy, StageClock, run_session

_FRAMES = 30
"""Whose times are shown and judged."""
_KEPT_BLOCKS = 3

Work = Callable[[Bracket, Seen], None]


@dataclass(frozen=True, eq=False)
class _Held:
    """A merged bracket, kept as long as the light is frozen."""

    image: RadianceImage
    bracket: Bracket


class LiveSession:
    """What becomes of each bracket of one source.

    Parameters
    ----------
    desk : Desk
    source : Source
    calibration : Calibration
    map_height : int
        Rows of the lat-long maps.
    picture : LivePicture or None
        None draws nothing.
    work : callable
        Told of each bracket and what was seen of it, for recordings and snapshots.

    Attributes
    ----------
    counters : Counters
        So far, whatever ends the session.
    """

    def __init__(
        self,
        desk: Desk,
        source: Source,
        calibration: Calibration,
        map_height: int,
        picture: LivePicture | None,
        work: Work,
    ) -> None:
        calibration.check_size(source.size_px, source.name)
        self._desk = desk
        self._source = source
        self._calibration = calibration
        self._picture = picture
        self._work = work
        self._remap = build_remap(calibration, map_height)
        self._blocks: dict[int, SourceBlocks] = {}
        self._memory: StreamMemory | None = None
        self._planned: Settings | None = None
        self._took_ms: float | None = None
        self._rate = FrameRate(desk.settings.frame_rate_hz)
        self._merged = PictureMemory()
        self._held: _Held | None = None
        self._exposure = ViewExposure()
        self._seen, age_s = desk.last_seen()
        self._seen_s = time.monotonic() - age_s
        self._published_s: deque[float] = deque(maxlen=_FRAMES)
        self._clock = StageClock(deque(maxlen=_FRAMES))
        self.counters = Counters()
        self._exposures_s = desk.settings.exposures_s
        self._is_seen_px = seen_pixels(calibration)

    def run(self) -> Counters:
        """Take brackets until the source ends or is stopped; what it raises is raised here."""
        counters, _ = run_session(
            self._source,
            self._process,
            policy=Policy.NEWEST,
            on_failure=self._on_failure,
            clock=self._clock,
        )
        self.counters = counters
        self.publish(State("ended", "The session has ended."))
        return counters

    def publish(self, state: State) -> None:
        """Publish the newest that was seen once more, in another state."""
        age_s = time.monotonic() - self._seen_s
        self._desk.publish(state, self._seen, age_s, self._account(age_s))

    def _on_failure(self, error: UnreadableFrame) -> None:
        if isinstance(error, CameraAway):
            self.publish(State("away", str(error)))

    def _process(self, bracket: Bracket, clock: StageClock, counters: Counters) -> None:
        self.counters = counters
        settings = self._desk.settings
        self._expose(settings.exposures_s)
        held = self._held if settings.is_frozen else None
        if held is None:
            with clock.stage("merge"):
                image = merge_bracket(bracket, self._source.sensor, self._merged)
            held = _Held(image, bracket)
        self._held = held if settings.is_frozen else None
        counters.merged += 1

        is_watched = self._desk.is_watched
        plan = self._plan(settings)
        environment = None
        if is_watched or plan.method not in BLOCK_METHODS:
            with clock.stage("remap"):
                environment = apply_remap(self._remap, held.image)
        lights = self._lights(held, environment, plan, clock)
        lights = turned_lights(lights, settings.yaw_rad)
        picture = None
        if is_watched:
            assert environment is not None
            environment = turned_map(environment, settings.yaw_rad)
            picture = self._drawn(settings, lights, environment, clock)
        self._judge(plan, clock.frames[-1])
        counters.rendered += 1

        camera = thinned(held.image, self._is_seen_px)
        view_ev = self._exposure.next_ev(
            settings.view_ev, picture, luminance(camera.radiance[camera.valid]).astype(np.float32)
        )
        is_draft = self._picture is not None and self._picture.is_draft
        self._seen = Seen(lights, camera, environment, picture, view_ev, is_draft)
        self._seen_s = held.bracket.timestamp_s
        self._published_s.append(time.monotonic())
        self.publish(state_of(lights, camera))
        self._work(bracket, self._seen)

    def _expose(self, exposures_s: tuple[float, ...] | None) -> None:
        """Have a camera expose as is asked for; what it cannot do is told, and not tried again."""
        if exposures_s == self._exposures_s:
            return
        self._exposures_s = exposures_s
        if isinstance(self._source, LiveSource):
            try:
                self._source.choose_exposures(exposures_s)
            except InputError as error:
                self._desk.answer(str(error), is_error=True)

    def _plan(self, settings: Settings) -> LightPlan:
        """Return what lights are wanted; other settings than before begin without memory."""
        if self._planned is None or _asked(settings) != _asked(self._planned):
            self._memory = self._took_ms = None
        self._planned = settings
        if settings.frame_rate_hz != self._rate.rate_hz:
            self._rate = FrameRate(settings.frame_rate_hz)
        return self._rate.planned(light_plan(settings))

    def _judge(self, plan: LightPlan, frame_ms: dict[str, float]) -> None:
        """Have the frame rate held by what this frame took."""
        assert self._memory is not None
        self._took_ms = frame_ms["lights"] + frame_ms.get("render", 0.0)
        if self._picture is not None and self._picture.is_settled and "render" in frame_ms:
            self._rate.judge(frame_ms, plan, self._memory)
        else:
            self._rate.note(frame_ms)

    def _lights(
        self,
        held: _Held,
        environment: EnvironmentMap | None,
        plan: LightPlan,
        clock: StageClock,
    ) -> LightSet:
        view: EnvironmentMap | BlockSums
        if plan.method in BLOCK_METHODS:
            with clock.stage("blocks"):
                view = apply_source_blocks(self._source_blocks(plan.block_rows), held.image)
        else:
            assert environment is not None
            view = environment
        with clock.stage("lights"):
            lights, self._memory = next_lights(
                view,
                plan,
                self._memory,
                took_ms=self._took_ms,
                timestamp_s=held.bracket.timestamp_s,
                source=f"{self._source.name}, bracket {held.bracket.index}",
            )
        return lights

    def _source_blocks(self, rows: int) -> SourceBlocks:
        blocks = self._blocks.pop(rows, None) or build_source_blocks(self._calibration, rows)
        self._blocks[rows] = blocks  # the last of them was used last
        if len(self._blocks) > _KEPT_BLOCKS:
            del self._blocks[next(iter(self._blocks))]
        return blocks

    def _drawn(
        self, settings: Settings, lights: LightSet, environment: EnvironmentMap, clock: StageClock
    ) -> NDArray[np.float32] | None:
        if self._picture is None:
            return None
        with clock.stage("render"):
            return self._picture.render(
                settings,
                lights,
                environment if settings.is_background else None,
                self._rate.size_px(self._picture.size_px),
            )

    def _pace(self) -> str | None:
        """Return what is drawn so that the frame rate is held, for people."""
        if self._rate.rate_hz is None or self._memory is None:
            return None
        lights = f"{self._memory.found} lights"
        if self._seen is None or self._seen.picture is None:
            return lights
        height, width = self._seen.picture.shape[:2]
        return f"{lights}, picture {width}×{height}"

    def _account(self, age_s: float) -> dict[str, Any]:
        """Return the numbers that people are shown."""
        frames = self._clock.frames
        times_ms = dict(frames[-1]) if frames else {}
        begun_s = self._published_s
        elapsed_s = begun_s[-1] - begun_s[0] if len(begun_s) > 1 else 0.0
        counters = self.counters
        return {
            "counters": vars(counters).copy(),
            "times_ms": {name: round(ms, 2) for name, ms in times_ms.items()},
            "frame_rate_hz": round((len(begun_s) - 1) / elapsed_s, 1) if elapsed_s else None,
            "pace": self._pace(),
            "latency_ms": round(1e3 * age_s, 1),
            "source": self._source.name,
            "size_px": self._source.size_px,
            "is_camera": isinstance(self._source, LiveSource),
            "reopened": self._source.reopened_count,
        }


def _asked(settings: Settings) -> tuple[object, ...]:
    """Return the settings that say which lights there are; other ones leave the memory alone."""
    return (
        settings.method,
        settings.is_auto,
        settings.count,
        settings.error,
        settings.frame_rate_hz,
        settings.is_steady,
    )
