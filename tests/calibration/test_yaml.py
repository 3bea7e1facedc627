"""YAML as calibration files hold it, and what is refused."""

from contextlib import suppress
from time import process_time

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from calibration.formats.yaml_text import parse_yaml
from capture.errors import InputError


def test_yaml_of_every_kind_that_is_written() -> None:
    text = (
        "%YAML:1.0\n---\n# a remark\na: 1  # another\nb: [1, 2.5, [x, 'y z'],\n   -1e-3]\n"
        "c: !!opencv-matrix\n   rows: 2\n   data: [ 1., 2. ]\n"
        "d:\n- - 1\n  - 2\n- k: {u: true, v: ~}\n  l: '#'\ne:\n...\n"
    )
    assert parse_yaml(text) == {
        "a": 1,
        "b": [1, 2.5, ["x", "y z"], -1e-3],
        "c": {"rows": 2, "data": [1.0, 2.0]},
        "d": [[1, 2], {"k": {"u": True, "v": None}, "l": "#"}],
        "e": None,
    }


@pytest.mark.parametrize(
    "text",
    ["", "a: [1, 2", "a: [1 2]]", "a: *b", "a: &b 1", "a: |\n  b", "[" * 50 + "]" * 50, "- " * 99],
)
def test_other_yaml_is_refused(text: str) -> None:
    with pytest.raises(InputError):
        parse_yaml(text)


@given(st.text(alphabet="ab1.-: \n[]{},'\"#&!", max_size=60))
@settings(max_examples=60, deadline=None)
def test_any_text_is_yaml_or_refused(text: str) -> None:
    with suppress(InputError):  # anything else is raised, and fails the test
        parse_yaml(text)


@pytest.mark.parametrize("line", ["a" + 300_000 * " " + "b", "a: " + 300_000 * "1" + "x"])
def test_a_long_line_takes_no_longer_than_its_length(line: str) -> None:
    begun_s = process_time()
    with suppress(InputError):
        parse_yaml(line)
    assert process_time() - begun_s < 2.0  # by its square it took 100 s and more
