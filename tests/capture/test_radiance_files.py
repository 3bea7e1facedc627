"""Radiance files at the door: marks travel, primaries and exposures are honoured."""

import re
from pathlib import Path

import numpy as np
import OpenEXR
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from capture.errors import InputError
from capture.exr import read_exr, write_exr
from capture.radiance import RadianceImage
from capture.radiance_files import read_hdr, read_radiance, write_hdr, write_radiance

DATA = Path(__file__).resolve().parents[2].parent / "shared/data"
RGB = np.random.default_rng(2).random((4, 6, 3)).astype(np.float32)

# Rec.709 as ICC profiles state it, adapted to D50 by the Bradford transform (sRGB profiles).
ICC_REC709 = (0.6484, 0.3309, 0.3212, 0.5979, 0.1559, 0.0660, 0.3457, 0.3585)
ACESCG = (0.713, 0.293, 0.165, 0.830, 0.128, 0.044, 0.32168, 0.33767)


@st.composite
def radiance_images(draw: st.DrawFn) -> RadianceImage:
    height, width = draw(hnp.array_shapes(min_dims=2, max_dims=2, max_side=9))
    values = hnp.arrays(np.float32, (height, width, 3), elements=st.floats(0, 2.0**99, width=32))
    masks = hnp.arrays(np.bool_, (height, width))
    valid = draw(masks)
    radiance, variance = (draw(values) * valid[..., None] for _ in range(2))
    scale = draw(st.sampled_from(["relative", "cd/m²"]))
    return RadianceImage(radiance, variance, valid, draw(masks), scale)


@settings(max_examples=30, deadline=None)
@given(image=radiance_images())
def test_radiance_returns_with_all_its_marks(
    tmp_path_factory: pytest.TempPathFactory, image: RadianceImage
) -> None:
    path = tmp_path_factory.getbasetemp() / "round.exr"
    write_radiance(path, image)
    back, cleaned = read_radiance(path)
    for name in ("radiance", "variance", "valid", "clipped"):
        np.testing.assert_array_equal(getattr(back, name), getattr(image, name), err_msg=name)
    assert back.scale == image.scale
    assert not str(cleaned)


def test_file_of_another_program_is_valid_and_unclipped(tmp_path: Path) -> None:
    write_exr(tmp_path / "a.exr", dict(zip("RGB", np.moveaxis(RGB, -1, 0), strict=True)), {})
    picture = read_hdr(tmp_path / "a.exr")
    np.testing.assert_array_equal(picture.rgb, RGB)
    assert (picture.valid, picture.clipped, picture.variance) == (None, None, None)
    image, _ = read_radiance(tmp_path / "a.exr")
    assert image.valid.all()
    assert not image.clipped.any()
    assert not image.variance.any()


def test_what_is_no_radiance_is_marked_and_counted(tmp_path: Path) -> None:
    rgb = RGB.copy()
    rgb[0, 0, 1], rgb[1, 1, 0], rgb[2, 2, 2] = np.nan, np.inf, -3.0
    variance = np.full_like(rgb, 2.0)
    variance[3, 3] = np.nan, np.inf, 2.0
    write_hdr(tmp_path / "a.exr", rgb, variance=variance)
    raw = read_hdr(tmp_path / "a.exr").rgb
    np.testing.assert_array_equal(raw, rgb)  # the file's own values, not cleaned
    image, cleaned = read_radiance(tmp_path / "a.exr")
    assert str(cleaned) == "1 NaN, 1 infinite, 1 negative"
    assert np.argwhere(~image.valid).tolist() == [[0, 0], [1, 1]]
    assert image.radiance[2, 2, 2] == 0
    assert not image.radiance[~image.valid].any()
    assert not image.variance[~image.valid].any()
    assert image.variance[3, 3].tolist() == [0, 0, 2]


def test_marks_do_not_hide_the_colours_from_other_programs(tmp_path: Path) -> None:
    mask = RGB[..., 0] > 0.5
    write_hdr(tmp_path / "a.exr", RGB, valid=mask, clipped=~mask, attributes={"owner": "me"})
    file = read_exr(tmp_path / "a.exr")
    assert file.channels.keys() == {"R", "G", "B", "valid", "clipped"}
    np.testing.assert_array_equal(file.channels["valid"], mask.astype(np.float32))
    assert file.attributes["owner"] == "me"


def with_primaries(path: Path, rgb: np.ndarray, chromaticities: tuple[float, ...]) -> Path:
    channels = dict(zip("RGB", np.moveaxis(rgb, -1, 0), strict=True))
    write_exr(path, channels, {"chromaticities": chromaticities})
    return path


def test_rec709_under_another_white_stays_as_it_is(tmp_path: Path) -> None:
    picture = read_hdr(with_primaries(tmp_path / "a.exr", RGB, ICC_REC709))
    np.testing.assert_allclose(picture.rgb, RGB, atol=1e-3)  # four digits in the primaries


def test_acescg_is_converted_with_its_variance(tmp_path: Path) -> None:
    path = with_primaries(tmp_path / "a.exr", RGB, ACESCG)
    # The ACEScg to Rec.709 matrix with Bradford adaptation as it is published (ACES CTL, OCIO).
    matrix = np.array(
        [
            [1.70505, -0.62179, -0.08326],
            [-0.13026, 1.14080, -0.01055],
            [-0.02400, -0.12897, 1.15297],
        ]
    )
    picture = read_hdr(path)
    np.testing.assert_allclose(picture.rgb, RGB @ matrix.T, atol=2e-5)
    assert any("Rec.709" in note for note in picture.notes)
    variance = {f"variance.{name}": np.full(RGB.shape[:2], 1.0) for name in "RGB"}
    channels = dict(zip("RGB", np.moveaxis(RGB, -1, 0), strict=True)) | variance
    write_exr(path, channels, {"chromaticities": ACESCG})
    converted = read_hdr(path).variance
    assert converted is not None
    np.testing.assert_allclose(converted[0, 0], (matrix**2).sum(axis=1), rtol=1e-4)


@pytest.mark.parametrize("primaries", [(0.3,) * 8, (0.6, 0.0, 0.3, 0.6, 0.1, 0.1, 0.3, 0.3)])
def test_primaries_that_span_no_colours_are_refused(
    tmp_path: Path, primaries: tuple[float, ...]
) -> None:
    with pytest.raises(InputError, match="primaries that are no colours"):
        read_hdr(with_primaries(tmp_path / "a.exr", RGB, primaries))


def test_primaries_of_a_foreign_type_are_refused(tmp_path: Path) -> None:
    path = with_primaries(tmp_path / "a.exr", RGB, ACESCG)
    name = b"chromaticities\0chromaticities\0"
    path.write_bytes(path.read_bytes().replace(name, b"chromaticities\0chromaticitieX\0"))
    with pytest.raises(InputError, match="primaries that are no colours"):
        read_hdr(path)


@pytest.mark.parametrize("scale", ["cd/m²\n\x1b[2J", "", "W" * 41, 3.0])
def test_a_scale_that_is_no_unit_is_refused(tmp_path: Path, scale: object) -> None:
    channels = dict(zip("RGB", np.moveaxis(RGB, -1, 0), strict=True))
    write_exr(tmp_path / "a.exr", channels, {"radianceScale": scale})
    with pytest.raises(InputError, match=r"a\.exr: its scale is .*; wanted a unit") as caught:
        read_hdr(tmp_path / "a.exr")
    assert str(caught.value).isprintable()


def test_half_floats_that_overflowed_are_counted(tmp_path: Path) -> None:
    # 10⁶ in a half float is infinite: what another program lost is seen, not lit with.
    with np.errstate(over="ignore"):
        planes = {name: np.full((2, 4), 1e6).astype(np.float16) for name in "RGB"}
    planes["R"][0] = planes["G"][0] = planes["B"][0] = 65504
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    with OpenEXR.File(header, planes) as file:
        file.write(str(tmp_path / "a.exr"))
    image, cleaned = read_radiance(tmp_path / "a.exr")
    assert cleaned.infinite_count == 12
    np.testing.assert_array_equal(image.valid, [[True] * 4, [False] * 4])
    np.testing.assert_array_equal(image.radiance[0], 65504)


def test_a_sun_above_the_range_of_half_floats_is_written_in_full(tmp_path: Path) -> None:
    sun = np.full((2, 4, 3), 1e6, np.float32)
    for name in ("a.exr", "a.hdr"):
        write_hdr(tmp_path / name, sun)
        np.testing.assert_allclose(read_hdr(tmp_path / name).rgb, sun, rtol=1 / 256)


def test_luminance_alone_is_repeated(tmp_path: Path) -> None:
    write_exr(tmp_path / "a.exr", {"Y": RGB[..., 0], "A": RGB[..., 1]}, {})
    picture = read_hdr(tmp_path / "a.exr")
    np.testing.assert_array_equal(picture.rgb, np.repeat(RGB[..., :1], 3, axis=2))
    assert picture.notes == ("luminance repeated to grey",)


@pytest.mark.parametrize("names", [("R", "G"), ("depth.Z", "id"), ("Y", "RY", "BY")])
def test_file_without_colours_is_refused_and_its_channels_listed(
    tmp_path: Path, names: tuple[str, ...]
) -> None:
    write_exr(tmp_path / "a.exr", dict.fromkeys(names, RGB[..., 0]), {})
    with pytest.raises(InputError, match=re.escape(f"found {sorted(names)}")):
        read_hdr(tmp_path / "a.exr")


def hdr_file(path: Path, *lines: str) -> Path:
    text = "\n".join(["#?RADIANCE", *lines, "", "-Y 1 +X 1", ""])
    path.write_bytes(text.encode() + bytes([128, 128, 128, 129]))  # RGB (1, 1, 1)
    return path


def test_hdr_header_is_honoured_and_told(tmp_path: Path) -> None:
    picture = read_hdr(hdr_file(tmp_path / "a.hdr", "EXPOSURE=2"))
    np.testing.assert_array_equal(picture.rgb[0, 0], [0.5, 0.5, 0.5])
    assert picture.notes == ("EXPOSURE divided out",)


@pytest.mark.parametrize(
    ("line", "note"),
    [
        ("PRIMARIES=0 0 0 0 0 0 0 0", "zeros"),  # as Photoshop writes it
        ("PRIMARIES=.640 .330 .290 .600 .150 .060 .3333 .3333", "converted"),  # Radiance's own
    ],
)
def test_white_stays_white_under_all_primaries(tmp_path: Path, line: str, note: str) -> None:
    picture = read_hdr(hdr_file(tmp_path / "a.hdr", line))
    np.testing.assert_allclose(picture.rgb[0, 0], 1.0, rtol=1e-5)
    assert note in picture.notes[0]


def test_hdr_keeps_colours_and_refuses_what_it_cannot_hold(tmp_path: Path) -> None:
    path = tmp_path / "a.hdr"
    write_hdr(path, RGB, valid=RGB[..., 0] > 0.5)
    picture = read_hdr(path)
    np.testing.assert_allclose(picture.rgb, RGB, atol=1 / 256)
    assert picture.valid is None
    with pytest.raises(ValueError, match="finite"):
        write_hdr(path, -RGB)


def test_other_suffixes_and_existing_files_are_refused(tmp_path: Path) -> None:
    for path in (tmp_path / "a.png", tmp_path / "exr"):
        with pytest.raises(InputError, match=r"\.exr or \.hdr"):
            write_hdr(path, RGB)
        with pytest.raises(InputError, match=r"\.exr or \.hdr"):
            read_hdr(path)
    for name in ("a.exr", "A.HDR"):
        write_hdr(tmp_path / name, RGB)
        with pytest.raises(InputError, match="--force"):
            write_hdr(tmp_path / name, RGB, force=False)


@pytest.mark.data
def test_negative_pixels_of_real_maps_are_counted() -> None:
    paths = sorted(DATA.glob("env-pmndrs/*.exr"))
    if not paths:
        pytest.skip(f"no maps in {DATA}")
    for path in paths:  # all of them ring around their lights
        image, cleaned = read_radiance(path)
        assert cleaned.negative_count > 0, path
        assert image.valid.all(), path
