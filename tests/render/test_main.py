"""The command line's one place for errors: known ones are a line, others keep their traceback."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

import render.app
from capture.errors import InputError
from lighting.light_files import write_lights
from render.main import main
from tests.render.light_sets import random_lights


@pytest.fixture
def failing_command(monkeypatch):
    """A command that raises what it is given."""

    def install(error):
        def fail(*arguments, **settings):
            raise error

        monkeypatch.setattr(render.app, "app", fail)

    return install


def test_a_known_error_is_one_line_and_exit_code_2(failing_command, capsys):
    failing_command(InputError("a.exr: wanted this\n  got that"))
    with pytest.raises(SystemExit) as stop:
        main(["render"])
    assert stop.value.code == 2
    printed = capsys.readouterr()
    assert printed.err == "fishlight: a.exr: wanted this got that\n"
    assert printed.out == ""


def test_a_name_that_would_steer_a_terminal_is_made_harmless(failing_command, capsys):
    failing_command(InputError("a\x1b[2J\udcff.exr: no picture"))
    with pytest.raises(SystemExit):
        main(["render"])
    assert capsys.readouterr().err == "fishlight: a\ufffd[2J\ufffd.exr: no picture\n"


def test_too_little_memory_is_no_defect_and_one_line(failing_command, capsys):
    failing_command(MemoryError("Unable to allocate 80.2 MiB"))
    with pytest.raises(SystemExit) as stop:
        main(["render"])
    assert stop.value.code == 2
    assert "not enough memory" in capsys.readouterr().err


def test_a_defect_keeps_its_traceback(failing_command):
    failing_command(ValueError("a defect"))
    with pytest.raises(ValueError, match="a defect"):
        main(["render"])


@pytest.mark.parametrize(("chosen", "kept"), [(None, "passive"), ("active", "active")])
def test_waiting_threads_sleep_unless_told_otherwise(chosen, kept, failing_command, monkeypatch):
    monkeypatch.setenv("OMP_WAIT_POLICY", chosen or "")
    if chosen is None:
        monkeypatch.delenv("OMP_WAIT_POLICY")
    failing_command(KeyboardInterrupt())
    with pytest.raises(SystemExit):
        main(["render"])
    assert os.environ["OMP_WAIT_POLICY"] == kept


def test_an_interrupt_has_the_shells_exit_code(failing_command, capsys):
    failing_command(KeyboardInterrupt())
    with pytest.raises(SystemExit) as stop:
        main(["render"])
    assert stop.value.code == 130
    assert capsys.readouterr().err == ""


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["rendre"], "no command 'rendre'; did you mean render? See"),
        (["xyz"], "no command 'xyz'; there are record, import, "),
        (["calibrate", "lenss"], "no command 'lenss'; did you mean lens? See"),
        (["render", "--lights", "l.json", "-o", "p.png", "--nonsense"], "--nonsense"),
        (["render", "-o", "p.png"], "--lights"),
        (["render", "--lights", "none.json", "-o", "p.png"], "none.json"),
        (["replay", "none", "-o", "out"], "none"),
        (["replay", "none", "-o", "out", "--count", "many"], "many"),
    ],
)
def test_wrong_arguments_are_one_line_and_write_nothing(
    tmp_path, monkeypatch, capsys, arguments, message
):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(SystemExit) as stop:
        main(arguments)
    assert stop.value.code == 2
    printed = capsys.readouterr()
    assert message in printed.err
    assert printed.err.startswith("fishlight: ")
    assert printed.err.count("\n") == 1
    assert list(tmp_path.iterdir()) == []


def test_a_command_that_does_not_exist_waits_for_no_stage():
    program = (
        "import sys\n"
        "from render.main import main\n"
        "try: main()\n"
        "finally: print([name for name in sys.modules if name.endswith('_cli')])\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", program, "xyz"], capture_output=True, text=True, check=False
    )
    assert (done.returncode, done.stdout) == (2, "[]\n")


def test_every_command_of_every_stage_has_help(capsys):
    commands = ("import", "inspect", "simulate", "merge", "remap", "lights", "render", "replay")
    for command in (*commands, "doctor"):
        with pytest.raises(SystemExit) as stop:
            main([command, "--help"])
        assert stop.value.code == 0
        assert f"fishlight {command}" in capsys.readouterr().out


def test_the_overview_describes_every_command(capsys):
    with pytest.raises(SystemExit) as stop:
        main(["--help"])
    assert stop.value.code == 0
    printed = capsys.readouterr().out
    for described in ("Merge one bracket", "Render a scene", "Show what this machine"):
        assert described in printed


@pytest.fixture
def without_egl(monkeypatch):
    def no_egl(**_settings):
        raise Exception("libEGL.so not loaded")  # glcontext's

    monkeypatch.setattr("moderngl.create_context", no_egl)


def test_without_egl_render_draws_with_rays_and_says_so(without_egl, tmp_path, capsys):
    write_lights(tmp_path / "lights.json", random_lights(2, seed=0))
    wishes = ["--lights", str(tmp_path / "lights.json"), "--size", "64x48"]
    with pytest.raises(SystemExit) as stop:
        main(["render", *wishes, "-o", str(tmp_path / "p.png")])
    printed = capsys.readouterr()
    assert (stop.value.code, printed.err) == (0, "")
    assert "no OpenGL: drawn with rays" in printed.out
    assert (tmp_path / "p.png").is_file()


def test_without_egl_a_replay_draws_all_the_same(without_egl, tmp_path):
    recording = Path(__file__).parents[2] / "recordings/outdoor"
    small = ["--size", "64x48", "--height", "64", "--count", "12"]
    with pytest.raises(SystemExit) as stop:
        main(["replay", str(recording), "-o", str(tmp_path / "out"), *small])
    assert stop.value.code == 0
    assert list((tmp_path / "out/pictures").glob("*.png"))


def test_without_egl_doctor_notes_it_and_shows_the_rest(without_egl, capsys):
    with pytest.raises(SystemExit) as stop:
        main(["doctor"])
    printed = capsys.readouterr()
    assert (stop.value.code, printed.err) == (0, "")
    assert "MISSING" not in printed.out
    assert "no context, so no shadow maps" in printed.out
    assert "apt-get install" in printed.out
    assert "Python" in printed.out


def test_a_file_that_the_system_refuses_is_one_line(failing_command, capsys):
    failing_command(OSError(28, "No space left on device", "map.exr"))
    with pytest.raises(SystemExit) as stop:
        main(["remap"])
    assert stop.value.code == 2
    assert capsys.readouterr().err == "fishlight: map.exr: No space left on device\n"


@pytest.mark.parametrize("count", ["3.7", "many", "1e3"])
def test_a_count_that_is_no_whole_number_is_not_rounded(count, tmp_path, capsys):
    with pytest.raises(SystemExit) as stop:
        main(["lights", "map.exr", "-o", str(tmp_path / "lights.json"), "--count", count])
    assert stop.value.code == 2
    assert "--count: wanted a whole number" in capsys.readouterr().err


@pytest.mark.parametrize("missing", ["render.cli", "render.doctor"])
def test_a_broken_installation_is_one_line(missing, monkeypatch, capsys):
    for name in ("render.app", "render.doctor_cli"):
        monkeypatch.delitem(sys.modules, name, raising=False)
    monkeypatch.setitem(sys.modules, missing, None)
    with pytest.raises(SystemExit) as stop:
        main(["doctor"])
    assert stop.value.code == 2
    error = capsys.readouterr().err
    assert "the installation is broken" in error
    assert "make setup" in error


def test_record_starts_without_what_it_does_not_need():
    """A small machine records: what compiles kernels, converts colours or draws stays away."""
    program = (
        "import sys\n"
        "from render.app import app\n"
        "assert app['record'].default_command is not None\n"
        "print(*{name.partition('.')[0] for name in sys.modules})\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True
    )
    loaded = set(done.stdout.split())
    assert "cv2" in loaded
    heavy = {"numba", "colour", "moderngl", "av", "trimesh", "scipy", "OpenEXR", "matplotlib"}
    assert not loaded & heavy
