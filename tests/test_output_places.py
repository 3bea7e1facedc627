"""Every command that writes says at once that it cannot: before it reads what it is given.

The inputs named here do not exist, so that a command which looks at them first fails these tests.
"""

import pytest

from capture.errors import InputError
from tests.capture.command_line import run

COMMANDS = {
    "import": "import none.jpg",
    "inspect": "inspect none",
    "merge": "merge none.jpg",
    "calibrate lens": "calibrate lens none.png --board checkerboard:9x6 --square-mm 20",
    "calibrate ball": "calibrate ball none.exr",
    "calibrate response": "calibrate response none",
    "calibrate colour": "calibrate colour none.png",
    "calibrate sun": "calibrate sun none.jpg --calibration none.json --latitude-deg 0 "
    "--longitude-deg 0",
    "calibrate up": "calibrate up none.json --looks up",
    "calibrate vignetting": "calibrate vignetting none.exr --calibration none.json --from flat",
    "calibrate import": "calibrate import none.txt",
    "calibrate export": "calibrate export none.json --format colmap",
    "report": "report none.json",
    "simulate": "simulate none.exr --calibration none.json",
    "remap": "remap none.exr --calibration none.json",
    "combine": "combine none.exr --calibration none.json",
    "scale": "scale none.exr --illuminance-lx 100",
    "recover": "recover none.exr --illuminance-lx 100",
    "lights": "lights none.exr",
    "export": "export none.json",
    "chart sequence": "chart sequence none.sqlite",
    "render": "render --lights none.json",
    "live": "live none --port 0 --headless",
    "follow": "follow http://127.0.0.1:1/?token=none",
}
SUFFIXES = {
    "merge": ".exr",
    "remap": ".exr",
    "combine": ".exr",
    "scale": ".exr",
    "recover": ".exr",
    "export": ".usda",
    "chart sequence": ".svg",
    "render": ".png",
    "inspect": ".png",
    "report": ".html",
}
FOLDERS = ("import", "simulate", "live")


def tokens(command, place):
    flag = "--thumbnails" if command == "inspect" else "-o"
    return [*COMMANDS[command].split(), flag, place]


@pytest.mark.parametrize("command", COMMANDS)
def test_a_place_in_no_folder_is_refused_before_anything_is_read(command, tmp_path):
    place = tmp_path / "none" / f"out{SUFFIXES.get(command, '.json')}"
    with pytest.raises(InputError, match=r"none is not a folder; out.* cannot be (written|made)"):
        run(*tokens(command, place))


@pytest.mark.parametrize("command", [name for name in COMMANDS if name not in FOLDERS])
def test_a_file_that_exists_is_kept_and_refused_before_anything_is_read(command, tmp_path):
    place = tmp_path / f"out{SUFFIXES.get(command, '.json')}"
    place.write_text("mine")
    with pytest.raises(InputError, match=r"out.* exists; give --force to replace it"):
        run(*tokens(command, place))
    assert place.read_text() == "mine"


def test_replay_refuses_a_folder_with_something_else_before_it_reads(tmp_path):
    (tmp_path / "mine.txt").write_text("mine")
    with pytest.raises(InputError, match="is not empty; give --force"):
        run("replay", "none", "-o", tmp_path)
