"""Sequences show what their names say, at the times they say."""

import numpy as np
import pytest

from capture.errors import InputError
from lighting.blocks.summed_area import block_sums
from lighting.maps.environment import luminance
from lighting.simulation.sequences import RATE_HZ, SEQUENCES, Sequence, Source, frames

ROWS, COUNT = 16, 21
MIDDLE = COUNT // 2


def shown(name, **options):
    return list(frames(SEQUENCES[name], ROWS, COUNT, **options))


def flux(environment):
    return float(luminance(environment.integral()))


def directions(timed_maps):
    return np.array([[disc.direction for disc in timed.sources] for timed in timed_maps])


@pytest.mark.parametrize("name", SEQUENCES)
def test_the_truth_holds_the_sources_light_and_they_stand_where_it_says(name):
    for timed in shown(name):
        dark = Sequence(sky=SEQUENCES[name].sky)
        sky = next(frames(dark, ROWS, 1)).truth
        of_sources = sum(luminance(disc.irradiance) for disc in timed.sources)
        if SEQUENCES[name].cover is None:
            assert flux(timed.truth) == pytest.approx(flux(sky) + of_sources, rel=1e-5)
            moment = block_sums(timed.truth.radiance) - block_sums(sky.radiance)
            true = sum(luminance(disc.irradiance) * disc.direction for disc in timed.sources)
            # Spread over cells 11° wide, a source's moment is shorter by 1.3 %, at most; it points
            # where the sources are, but for 1e-4 rad with several points or sources.
            off = moment.sum(axis=(0, 1))[1:4] - true
            assert np.linalg.norm(off) <= 0.02 * of_sources
            assert np.linalg.norm(np.cross(off, true)) <= 2e-4 * of_sources**2


@pytest.mark.parametrize("name", [n for n, s in SEQUENCES.items() if s.noise == 0])
def test_without_noise_or_ripple_the_camera_sees_the_truth(name):
    ripples = any(source.ripple for source in SEQUENCES[name].sources)
    same = [np.array_equal(t.environment.radiance, t.truth.radiance) for t in shown(name)]
    assert not all(same[1:]) if ripples else all(same)


@pytest.mark.parametrize("name", SEQUENCES)
def test_the_same_every_time(name):
    first, second = shown(name, irregular=True), shown(name, irregular=True)
    for one, other in zip(first, second, strict=True):
        assert one.timestamp_s == other.timestamp_s
        np.testing.assert_array_equal(one.environment.radiance, other.environment.radiance)


def test_frames_come_at_an_even_rate_or_not():
    even = [timed.timestamp_s for timed in shown("two suns")]
    np.testing.assert_allclose(even, np.arange(COUNT) / RATE_HZ, atol=1e-12)
    uneven = np.diff([timed.timestamp_s for timed in shown("two suns", irregular=True)]) * RATE_HZ
    assert uneven.min() > 0
    assert uneven.min() < 0.8
    assert uneven.sum() == pytest.approx(COUNT - 1 + 2, abs=0.8)  # two frames are missing


def test_every_tenth_frame_is_missing():
    # A hundred of 111, each at most 0.4 frames early or late.
    times_s = [t.timestamp_s for t in frames(SEQUENCES["two suns"], 8, 100, irregular=True)]
    numbers = np.arange(100) + np.arange(100) // 9
    off = np.array(times_s) * RATE_HZ - numbers
    assert np.ptp(off) < 0.8


def test_what_is_covered_is_dimmed_sky_and_source_each_by_its_own():
    source = Source(1.0, lambda _time_s: np.array([0.0, 1.0, 0.0]))
    plain = next(frames(Sequence((source,), sky=1.0), 16, 1)).truth
    covered = next(
        frames(
            Sequence(
                (source,),
                cover=lambda directions, _time_s: np.ones(directions.shape[:-1]),
                covered_sky=0.5,
                covered_source=0.25,
            ),
            16,
            1,
        )
    )
    np.testing.assert_allclose(covered.truth.radiance[2:], 0.5 * plain.radiance[2:], rtol=1e-6)
    half = flux(plain) / 2  # of both, sky and source
    assert flux(covered.truth) == pytest.approx(0.75 * half, rel=1e-5)


@pytest.mark.parametrize("kind", ["hard", "soft"])
def test_a_sun_crosses_the_seam_in_the_middle(kind):
    path = directions(shown(f"{kind} sun over the seam"))[:, 0]
    azimuth_deg = np.degrees(np.arctan2(path[:, 0], path[:, 2]))
    assert (azimuth_deg[:MIDDLE] > 170).all()
    assert (azimuth_deg[MIDDLE + 1 :] < -170).all()
    assert abs(azimuth_deg[MIDDLE]) == pytest.approx(180)
    assert azimuth_deg[1] - azimuth_deg[0] == pytest.approx(0.5)


@pytest.mark.parametrize("kind", ["hard", "soft"])
def test_a_sun_crosses_the_pole_in_the_middle(kind):
    path = directions(shown(f"{kind} sun over the pole"))[:, 0]
    np.testing.assert_allclose(path[MIDDLE], [0, 1, 0], atol=1e-12)
    turns = np.degrees(np.arccos((path[1:] * path[:-1]).sum(axis=1)))
    np.testing.assert_allclose(turns, 0.5, rtol=1e-6)


def test_a_hard_sun_is_fewer_cells_than_a_soft_one():
    hard, soft = (shown(f"{kind} sun over the seam")[3].truth for kind in ("hard", "soft"))
    lit = [np.count_nonzero(luminance(each.radiance) > 3) for each in (hard, soft)]
    assert lit[0] <= 4 < lit[1]


def test_two_suns_swap_two_percent_each_frame():
    one, other = np.transpose(
        [[luminance(disc.irradiance) for disc in timed.sources] for timed in shown("two suns")]
    )
    np.testing.assert_allclose(one + other, one[0] + other[0])
    np.testing.assert_allclose(np.abs(np.diff(one / (one + other))), 0.02)


def test_one_lamp_dims_as_the_other_brightens_and_both_stand():
    timed_maps = list(frames(SEQUENCES["one lamp for another"], ROWS, 31))
    power = np.array([[luminance(d.irradiance) for d in timed.sources] for timed in timed_maps])
    assert (np.diff(power[:, 0]) <= 0).all()
    assert (np.diff(power[:, 1]) >= 0).all()
    np.testing.assert_allclose(power.sum(axis=1), power.sum(axis=1)[0], rtol=1e-5)
    assert power[0, 1] == power[-1, 0] == 0
    assert np.ptp(directions(timed_maps), axis=0).max() == 0


def test_a_cloud_covers_the_sun_and_the_sky_stays():
    timed_maps = list(frames(SEQUENCES["cloud front"], ROWS, 41))
    power = [luminance(timed.sources[0].irradiance) for timed in timed_maps]
    assert power[-1] == pytest.approx(0.02 * power[0])
    assert (np.diff(power) <= 1e-12).all()
    ground = np.s_[ROWS // 2 :]
    np.testing.assert_array_equal(
        timed_maps[0].truth.radiance[ground], timed_maps[-1].truth.radiance[ground]
    )


def test_a_switch_lights_the_lamp_in_the_middle():
    power = [luminance(timed.sources[0].irradiance) for timed in shown("light switch")]
    assert not any(power[:MIDDLE])
    assert all(power[MIDDLE:])


def test_a_passer_by_hides_the_lamp_in_the_middle():
    timed_maps = frames(SEQUENCES["passer-by"], ROWS, 61)
    power = [luminance(timed.sources[0].irradiance) for timed in timed_maps]
    assert power[0] > 0
    assert power[30] == pytest.approx(0, abs=1e-12)
    assert power[-1] == pytest.approx(power[0])


def test_mains_ripple_is_seen_as_ten_hertz():
    # 100 Hz at 30 frames a second: 100 = 3·30 + 10.
    timed_maps = list(frames(SEQUENCES["mains alias"], ROWS, 30))
    ripple = np.array([flux(timed.environment) for timed in timed_maps])
    assert np.abs(np.fft.rfft(ripple - ripple.mean())).argmax() == 10
    assert len({flux(timed.truth) for timed in timed_maps}) == 1


@pytest.mark.parametrize(
    ("name", "noise"), [("still, 1 % noise", 0.01), ("small lamp, 3 % noise", 0.03)]
)
def test_noise_is_as_strong_as_named(name, noise):
    timed = shown(name)[0]
    relative = timed.environment.radiance / timed.truth.radiance - 1
    assert relative.std() == pytest.approx(noise, rel=0.1)
    assert abs(relative.mean()) < 4 * noise / np.sqrt(relative.size)


def test_the_small_lamp_is_small_and_moves_slowly():
    timed_maps = shown("small lamp, 3 % noise")
    share = luminance(timed_maps[0].sources[0].irradiance) / flux(timed_maps[0].truth)
    assert share == pytest.approx(0.15, rel=1e-5)
    path = directions(timed_maps)[:, 0]
    turns = np.degrees(np.arccos((path[1:] * path[:-1]).sum(axis=1)))
    np.testing.assert_allclose(turns, 0.4, rtol=1e-6)


def test_a_sequence_of_ones_own():
    own = Sequence((Source(1.0, lambda _time_s: np.array([0.0, 0.0, 2.0])),), sky=0.0)
    (timed,) = frames(own, 16, 1)
    np.testing.assert_array_equal(timed.sources[0].direction, [0, 0, 1])
    assert timed.timestamp_s == 0


@pytest.mark.parametrize(("height", "count"), [(7, 5), (16, 0)])
def test_too_small_is_refused(height, count):
    with pytest.raises(InputError, match="8 rows or more and 1 frame or more"):
        next(frames(SEQUENCES["two suns"], height, count))
