"""Files that were forged: whatever is in them, a reader returns or raises InputError, soon.

Valid files are changed where their structure says that something stands: values of JSON objects,
lines of a header, numbers of a table. tests/capture/test_damaged_files.py changes mere bytes.
`pytest tests/test_fuzzed_files.py --hypothesis-profile=fuzz` tries a hundred times as much.
"""

import copy
import json
import struct
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import OpenEXR
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image

from calibration.camera import Calibration, ImageCircle
from calibration.files import read_calibration, write_calibration
from calibration.models.double_sphere import DoubleSphere
from calibration.models.equisolid import Equisolid
from calibration.models.kannala_brandt import KannalaBrandt
from calibration.models.mirror_ball import MirrorBall
from calibration.models.ocam import OCam
from calibration.models.splined_radial import SplinedRadial
from capture.errors import InputError
from capture.exif import read_exif
from capture.frame import Bracket, Exposure
from capture.inspecting import describe, examine
from capture.manifest import JOURNAL_NAME, MANIFEST_NAME
from capture.merge import merge_bracket
from capture.pictures import read_picture
from capture.radiance_files import read_radiance, write_hdr
from capture.raw import raw_sensor, read_raw
from capture.recording import open_recording
from capture.recording_writer import create_recording
from capture.sensor import assumed_sensor
from lighting.light_files import read_lights, write_lights
from lighting.light_set import LightSet
from tests.capture.dng_files import dng

# Of the profile: 100 by default, 20,000 of the one named fuzz (tests/conftest.py).
LIMITS = settings(max_examples=settings.default.max_examples // 5, deadline=5000)

COUNTS = np.random.default_rng(1).integers(0, 256, (8, 12, 3), dtype=np.uint8)


def read(reader: Callable[[Path], object], path: Path) -> None:
    """Return, or fail unless what is raised is an InputError in one line that can be printed."""
    try:
        reader(path)
    except InputError as error:
        message = str(error)
        assert path.name in message or path.parent.name in message
        assert len(message.splitlines()) == 1
        assert message.isprintable()


# ---- JSON ----

STRANGE = st.one_of(
    st.none(),
    st.booleans(),
    st.sampled_from([0, -1, 1, 255, 256, 2**31, 2**53, 2**63, 2**64, 10**30]),
    st.sampled_from([0.5, -0.0, 1e-320, 1e300, -1e300, 1e-9, 1e9]),
    st.text(max_size=6),
    st.sampled_from(["/etc/passwd", "../a.png", "a\0b", "frames", ".", "linear", "\x1b[2J", "é"]),
    st.sampled_from([[], {}, [[]], [1.0] * 3, [[1.0] * 3] * 3, [[0.0] * 3] * 256]).map(
        copy.deepcopy
    ),
)


def places(value: Any, path: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """The path of everything inside a JSON value."""
    inside = value.items() if isinstance(value, dict) else enumerate(value)
    for key, part in inside:
        yield (*path, key)
        if isinstance(part, (dict, list)):
            yield from places(part, (*path, key))


@st.composite
def forged(draw: st.DrawFn, content: dict[str, Any]) -> bytes:
    """JSON text of `content` with some values replaced, removed or exchanged, and perhaps cut."""
    content = copy.deepcopy(content)
    for _ in range(draw(st.integers(1, 3))):
        known = list(places(content))
        if not known:
            break
        *path, last = draw(st.sampled_from(known))
        inner: Any = content
        for key in path:
            inner = inner[key]
        action = draw(st.sampled_from(["replace", "replace", "scale", "remove", "double"]))
        if action == "remove":
            del inner[last]
        elif action == "double" and isinstance(inner, list):
            inner.append(copy.deepcopy(inner[last]))
        elif action == "scale" and isinstance(inner[last], (int, float)):
            inner[last] *= draw(st.sampled_from([-1, 0, 2, 1e-12, 1e12, 1e150]))
        else:
            inner[last] = draw(STRANGE)
    text = json.dumps(content, ensure_ascii=draw(st.booleans())).encode(errors="surrogatepass")
    cut = draw(st.none() | st.integers(0, len(text)))
    return text[:cut]


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, Any]]:
    """A recording's folder and its manifest."""
    folder = tmp_path_factory.mktemp("recordings") / "recording"
    with create_recording(folder, "Test 1", assumed_sensor(np.uint8)) as writer:
        for bracket in range(2):
            for time_s in (0.1, 0.01):
                writer.write_frame(COUNTS, Exposure(time_s), float(bracket), bracket)
    return folder, json.loads((folder / MANIFEST_NAME).read_text())


def use_recording(folder: Path) -> None:
    recording = open_recording(folder)
    for bracket in recording:
        if isinstance(bracket, Bracket):
            merge_bracket(bracket, recording.sensor)
    describe(recording, examine(recording))


@LIMITS
@given(data=st.data())
def test_a_forged_manifest(recording: tuple[Path, dict[str, Any]], data: st.DataObject) -> None:
    folder, valid = recording
    (folder / MANIFEST_NAME).write_bytes(data.draw(forged(valid)))
    read(use_recording, folder)


@LIMITS
@given(data=st.data())
def test_a_forged_journal(recording: tuple[Path, dict[str, Any]], data: st.DataObject) -> None:
    folder, valid = recording
    (folder / MANIFEST_NAME).write_text(json.dumps(valid | {"frames": valid["frames"][:2]}))
    numbers = data.draw(st.lists(st.integers(0, 3), max_size=4))
    lines = [data.draw(forged(valid["frames"][number])) for number in numbers]
    journal = folder / JOURNAL_NAME
    journal.write_bytes(b"\n".join([*lines, data.draw(st.binary(max_size=8))]))
    try:
        read(use_recording, folder)
    finally:
        journal.unlink()


CENTRE = (319.5, 239.5)
CAMERAS = [
    Calibration(
        model,
        (640, 480),
        1.5,
        image_circle=ImageCircle(CENTRE, 230.0),
        vignetting=(-0.1, 0.01),
    )
    for model in (
        Equisolid(CENTRE, (150.5, 149.0)),
        KannalaBrandt(CENTRE, (150.0, 151.0), 0.03, -0.01, 0.004, -0.0006),
        OCam(CENTRE, 209.3, (-0.46, 0.224, -0.197), 0.99887, -0.000169, 0.00011),
        DoubleSphere(CENTRE, 130.0, -0.244, 0.566),
        SplinedRadial(CENTRE, 150.0, 1.9, (0.01, 0.02, -0.1)),
        MirrorBall(CENTRE, 200.1, 7.3),
    )
]


def use_calibration(path: Path) -> None:
    calibration = read_calibration(path)
    calibration.unproject(np.array([[0.0, 0.0], [319.5, 239.5], [600.0, 100.0]]))


@LIMITS
@given(data=st.data())
def test_a_forged_calibration(
    tmp_path_factory: pytest.TempPathFactory, data: st.DataObject
) -> None:
    path = tmp_path_factory.getbasetemp() / "forged-camera.json"
    write_calibration(path, data.draw(st.sampled_from(CAMERAS)))
    path.write_bytes(data.draw(forged(json.loads(path.read_text()))))
    read(use_calibration, path)


LIGHTS = LightSet(
    np.array([[0.0, 1.0, 0.0], [0.6, 0.8, 0.0]]),
    np.array([[1.0, 2.0, 3.0], [0.5, 0.5, 0.5]]),
    np.array([0.0, 0.1]),
    is_key=np.array([True, False]),
    fill=np.array([[1.0, 1.0, 1.0], *[[0.01, 0.0, 0.02]] * 8]),
    predicted_error=0.01,
)


@LIMITS
@given(data=st.data())
def test_forged_lights(tmp_path_factory: pytest.TempPathFactory, data: st.DataObject) -> None:
    path = tmp_path_factory.getbasetemp() / "forged-lights.json"
    write_lights(path, LIGHTS, force=True)
    path.write_bytes(data.draw(forged(json.loads(path.read_text()))))
    read(read_lights, path)


# ---- Headers ----

HDR_LINES = st.one_of(
    st.sampled_from(["#?RADIANCE", "#?RGBE", "# a comment", "FORMAT=32-bit_rle_rgbe", "=", "X=Y"]),
    st.sampled_from(["FORMAT=32-bit_rle_xyze", "FORMAT=", "VIEW=-vta -vv 180", "\r", "\0"]),
    st.builds(
        "{}={}".format,
        st.sampled_from(["EXPOSURE", "COLORCORR", "PRIMARIES", "FORMAT"]),
        st.sampled_from(["2", "0", "-1", "nan", "1e-400", "1e300", "1 1 1", "1 2", "x", "0 " * 8])
        | st.text(max_size=5),
    ),
)
SIZES = st.sampled_from([0, 1, 4, 7, 8, 40000, 2**27, 2**31, 999999999]) | st.integers(0, 20)
RESOLUTIONS = st.builds(
    "{}{} {} {}{} {}".format,
    *(st.sampled_from("+-"), st.sampled_from("XYZ"), SIZES) * 2,
) | st.text(max_size=12)


@LIMITS
@given(
    lines=st.lists(HDR_LINES, max_size=5),
    resolution=RESOLUTIONS,
    pixels=st.binary(max_size=80) | st.binary(min_size=4, max_size=4).map(lambda p: p * 64),
)
def test_a_forged_hdr_header(
    tmp_path_factory: pytest.TempPathFactory, lines: list[str], resolution: str, pixels: bytes
) -> None:
    path = tmp_path_factory.getbasetemp() / "forged.hdr"
    text = "\n".join(["#?RADIANCE", *lines, "", resolution, ""])
    path.write_bytes(text.encode(errors="surrogatepass") + pixels)
    read(read_radiance, path)


@pytest.fixture(scope="module")
def originals(tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    folder = tmp_path_factory.mktemp("originals")
    exif = Image.Exif()
    exif.get_ifd(0x8769).update({33434: 0.01, 36867: "2024:06:01 12:00:00"})
    Image.fromarray(COUNTS).save(folder / "a.jpg", exif=exif)
    Image.fromarray(COUNTS).save(folder / "a.png", exif=exif)
    Image.fromarray(COUNTS).save(folder / "a.tif", exif=exif)
    write_hdr(folder / "a.exr", COUNTS / np.float32(64), scale="cd/m²")
    matrices = [(17, np.eye(3)), (21, np.eye(3))]
    mosaic = np.full((24, 32), 3000)
    (folder / "a.dng").write_bytes(dng(mosaic, matrices=matrices, forward=np.eye(3)))
    tiles = {"type": OpenEXR.tiledimage, "tiles": OpenEXR.TileDescription()}
    with OpenEXR.File(tiles, {"Y": np.ones((40, 70), np.float32)}) as file:
        file.write(str(folder / "tiles.exr"))
    return {path.name: path.read_bytes() for path in folder.iterdir()}


NUMBERS = st.sampled_from(
    [0, 1, 2, 3, 4, 0x7F, 0x80, 0xFF, 0x7FFF, 0x8000, 0xFFFF, 2**27, 2**31 - 1, 2**31, 2**32 - 1]
) | st.integers(0, 2**32 - 1)


@st.composite
def renumbered(draw: st.DrawFn, content: bytes) -> bytes:
    """The file with some of the numbers of its header replaced, or a part of it taken out."""
    changed = bytearray(content)
    for _ in range(draw(st.integers(1, 3))):
        place = draw(st.integers(4, min(len(content), 1500) - 8))
        size = draw(st.sampled_from("BHIQ"))
        order = draw(st.sampled_from("<>"))
        number = draw(NUMBERS | st.just(len(content)) | st.just(place))
        coded = struct.pack(f"{order}{size}", number % 2 ** (8 * struct.calcsize(size)))
        changed[place : place + len(coded)] = coded
    if draw(st.booleans()):
        start = draw(st.integers(4, len(changed)))
        del changed[start : start + draw(st.integers(0, 16))]
    return bytes(changed)


def use_raw(path: Path) -> None:
    raw_sensor(read_raw(path)[1])


@pytest.mark.parametrize(
    ("name", "readers"),
    [
        ("a.jpg", (read_picture, read_exif)),
        ("a.png", (read_picture, read_exif)),
        ("a.tif", (read_picture, read_exif)),
        ("a.exr", (read_radiance,)),
        ("tiles.exr", (read_radiance,)),
        ("a.dng", (use_raw, read_exif)),
    ],
)
def test_a_forged_header(
    tmp_path_factory: pytest.TempPathFactory,
    originals: dict[str, bytes],
    name: str,
    readers: tuple[Callable[[Path], object], ...],
) -> None:
    path = tmp_path_factory.getbasetemp() / f"forged-{name}"

    @LIMITS
    @given(content=renumbered(originals[name]))
    def holds(content: bytes) -> None:
        path.write_bytes(content)
        for reader in readers:
            read(reader, path)

    holds()
