"""Photographs: their order, their exposures, their brackets; no pixels."""

from collections import Counter
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from capture.errors import InputError
from capture.frame import Exposure
from capture.photographs import (
    bracket_length,
    check_alike,
    find_photographs,
    plan_brackets,
)
from tests.capture.photo_files import DATA, write_photograph


@given(
    exposures=st.lists(st.integers(0, 99), min_size=1, max_size=7, unique=True),
    repetitions=st.integers(2, 6),
    random=st.randoms(use_true_random=False),
)
@settings(max_examples=100, deadline=None)
def test_brackets_end_where_the_exposures_begin_again_in_any_order(exposures, repetitions, random):
    sequence = []
    for _ in range(repetitions):
        random.shuffle(exposures)
        sequence += exposures
    assert bracket_length(sequence) == len(exposures)


@given(exposures=st.lists(st.integers(0, 3), min_size=1, max_size=24))
@settings(max_examples=200, deadline=None)
def test_whole_brackets_always_hold_the_same_exposures(exposures):
    length = bracket_length(exposures)
    runs = [
        Counter(exposures[start : start + length]) for start in range(0, len(exposures), length)
    ]
    assert all(run == runs[0] for run in runs[:-1])
    assert runs[-1] <= runs[0]


def test_exposures_that_all_differ_are_one_bracket():
    assert bracket_length([1, 2, 3, 4]) == 4
    assert bracket_length([1]) == 1


def test_a_cut_last_bracket_is_found():
    assert bracket_length([1, 2, 3, 3, 2, 1, 2]) == 3


def test_a_folder_is_taken_in_the_natural_order_of_its_names(tmp_path):
    for name in ("img10.jpg", "img9.JPG", "img1.png", ".img0.jpg", "notes.txt"):
        (tmp_path / name).write_bytes(b"x")
    assert [path.name for path in find_photographs([tmp_path])] == [
        "img1.png",
        "img9.JPG",
        "img10.jpg",
    ]


@pytest.mark.parametrize(
    ("names", "told"),
    [
        ((), "no picture"),
        (("a.txt",), "no picture"),
        (("a.jpg", "a.cr2"), "different kinds"),
        (("a.jpg", "a.exr"), "different kinds"),
    ],
)
def test_a_folder_that_is_no_series_is_refused(tmp_path, names, told):
    for name in names:
        (tmp_path / name).write_bytes(b"x")
    with pytest.raises(InputError, match=told):
        find_photographs([tmp_path])


def test_an_empty_folder_among_others_is_named(tmp_path):
    (tmp_path / "a.jpg").write_bytes(b"x")
    (tmp_path / "recording").mkdir()
    with pytest.raises(InputError, match="recording: no picture"):
        find_photographs([tmp_path / "a.jpg", tmp_path / "recording"])


def test_a_photograph_counts_once(tmp_path):
    (tmp_path / "a.jpg").write_bytes(b"x")
    with pytest.raises(InputError, match=r"a\.jpg is named 2 times"):
        find_photographs([tmp_path, tmp_path / "a.jpg"])


def test_a_missing_file_is_named(tmp_path):
    with pytest.raises(InputError, match=r"gone\.jpg: no such file"):
        find_photographs([tmp_path / "gone.jpg"])


def test_brackets_follow_the_time_they_were_taken_not_the_names(tmp_path):
    shots = {"d": (1.0, "10"), "c": (0.25, "20"), "b": (1.0, "30"), "a": (0.25, "40")}
    paths = [
        write_photograph(
            tmp_path / f"{name}.jpg", time_s, taken="2024:06:01 12:00:00", fraction=fraction
        )
        for name, (time_s, fraction) in shots.items()
    ]
    plan = plan_brackets(sorted(paths))
    assert [[shot.path.stem for shot in bracket] for bracket in plan.brackets] == [
        ["d", "c"],
        ["b", "a"],
    ]
    times_s = [shot.timestamp_s for bracket in plan.brackets for shot in bracket]
    # A float of seconds since 1970 resolves a quarter of a microsecond.
    assert times_s == pytest.approx([0.0, 0.1, 0.2, 0.3], abs=1e-6)
    assert plan.brackets[0][1].exposure == Exposure(0.25, 1.0, 8.0)
    assert plan.camera == "Test 1"
    assert plan.notes == ()


def test_without_times_brackets_are_put_a_second_apart_and_the_user_is_told(tmp_path):
    paths = [write_photograph(tmp_path / f"{i}.jpg", (0.1, 0.01)[i % 2]) for i in range(4)]
    plan = plan_brackets(paths)
    assert [shot.timestamp_s for bracket in plan.brackets for shot in bracket] == [0, 0, 1, 1]
    assert "1 s apart" in plan.notes[0]


@pytest.mark.parametrize("time_s", [None, 0.0, 4e9])
def test_a_missing_or_impossible_exposure_names_the_file_and_the_remedy(tmp_path, time_s):
    paths = [
        write_photograph(tmp_path / "good.jpg", 0.1),
        write_photograph(tmp_path / "bad.jpg", time_s),
    ]
    with pytest.raises(InputError, match=r"bad\.jpg.*--exposures"):
        plan_brackets(paths)


def test_given_exposures_stand_before_anything_exif_says(tmp_path):
    paths = [
        write_photograph(tmp_path / "0.jpg", 0.0, iso=None),
        write_photograph(tmp_path / "1.jpg", None, f_number=None),
        write_photograph(tmp_path / "2.jpg", 5.0, iso=1600),
        write_photograph(tmp_path / "3.jpg", 5.0),
    ]
    plan = plan_brackets(paths, [0.5, 0.25])
    assert [[shot.exposure for shot in bracket] for bracket in plan.brackets] == [
        [Exposure(0.5), Exposure(0.25)]
    ] * 2
    assert [shot.path for bracket in plan.brackets for shot in bracket] == paths


@pytest.mark.parametrize("times_s", [[0.0], [-1.0], [float("nan")], [float("inf")], []])
def test_given_exposures_must_be_exposures(tmp_path, times_s):
    with pytest.raises(InputError, match="--exposures"):
        plan_brackets([write_photograph(tmp_path / "0.jpg", 0.1)], times_s)


def test_photographs_left_over_are_refused(tmp_path):
    paths = [write_photograph(tmp_path / f"{i}.jpg", (1.0, 0.1)[i % 2]) for i in range(5)]
    with pytest.raises(InputError, match=r"5 photographs.*1 left over, the last .*4\.jpg"):
        plan_brackets(paths)
    with pytest.raises(InputError, match="2 left over"):
        plan_brackets(paths, [1.0, 0.1, 0.01])


@pytest.mark.parametrize(
    ("odd", "told"),
    [
        ({"camera": "Other 2"}, "camera"),
        ({"orientation": 6}, "orientation"),
        ({"iso": None}, "ISO speed"),
        ({"f_number": None}, "f-number"),
    ],
)
def test_the_odd_one_out_is_named(tmp_path, odd, told):
    paths = [write_photograph(tmp_path / f"{i}.jpg", 0.1 / 2**i) for i in range(3)]
    paths.append(write_photograph(tmp_path / "odd.jpg", 1.0, **odd))
    with pytest.raises(InputError, match=told) as caught:
        plan_brackets(paths)
    assert "odd.jpg" in str(caught.value)


def test_many_odd_ones_are_counted_not_listed():
    paths = [Path(f"{i}.jpg") for i in range(20)]
    with pytest.raises(InputError, match=r"4\.jpg \(5\) and 5 more"):
        check_alike("size", paths, [0] + list(range(2, 11)) + [0] * 10)


def test_radiance_files_are_a_bracket_each_of_one_second():
    plan = plan_brackets([Path("a.exr"), Path("b.exr")])
    assert [[shot.exposure for shot in bracket] for bracket in plan.brackets] == [
        [Exposure(1.0)],
        [Exposure(1.0)],
    ]
    with pytest.raises(InputError, match="--exposures"):
        plan_brackets([Path("a.exr")], [1.0])


@pytest.mark.data
@pytest.mark.parametrize(
    ("folder", "lengths", "longest_s"),
    [
        ("brackets-lumilab-fisheye/JPEG", [10], 13.0),
        ("brackets-bigchou/exp/ex_1", [14], 1 / 160),
        ("brackets-mpi-exposures/exposures", [13], 13.0),
        ("brackets-frobisher/frobisher_001", [3], 8.0),
    ],
)
def test_real_brackets_are_recognised(folder, lengths, longest_s):
    if not (DATA / folder).is_dir():
        pytest.skip(f"{folder} is not at hand")
    plan = plan_brackets(find_photographs([DATA / folder]))
    assert [len(bracket) for bracket in plan.brackets] == lengths
    times_s = [shot.exposure.time_s for bracket in plan.brackets for shot in bracket]
    assert max(times_s) == pytest.approx(longest_s)
