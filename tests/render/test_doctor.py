"""What doctor finds on machines that lack something."""

import importlib.metadata
import types
from pathlib import Path

import cv2
import pytest

from capture.errors import FishlightError
from render import doctor, doctor_cli
from render.doctor import OPENCV_DISTRIBUTIONS, Finding
from render.opengl.context import REMEDY, GlUnavailable


def finding(subject):
    return next(item for item in doctor.examine() if item.subject == subject)


def install_opencv(monkeypatch, *names):
    def distribution(name):
        if name not in names:
            raise importlib.metadata.PackageNotFoundError(name)

    monkeypatch.setattr(importlib.metadata, "distribution", distribution)


def without_egl():
    raise GlUnavailable(f"OpenGL is not available (no EGL). Install it: {REMEDY}")


@pytest.mark.gl
def test_this_machine_is_as_its_tests_need_it():
    by_subject = {item.subject: item for item in doctor.examine()}
    assert list(by_subject) == ["Python", "OpenCV", "OpenGL", "Cameras"]
    assert all(by_subject[name].is_good for name in ("Python", "OpenCV", "OpenGL"))
    assert cv2.__version__ in by_subject["OpenCV"].found


def test_an_emptied_contrib_module_is_found(monkeypatch):
    # What is left after a second wheel was installed over the first and removed again.
    monkeypatch.setattr(cv2, "omnidir", types.ModuleType("omnidir"))
    broken = finding("OpenCV")
    assert not broken.is_good
    assert "contrib broken" in broken.found
    for name in OPENCV_DISTRIBUTIONS:
        assert name in broken.remedy
    assert broken.remedy.endswith("pip install opencv-contrib-python-headless")


def test_a_missing_contrib_module_is_found(monkeypatch):
    monkeypatch.delattr(cv2, "omnidir")
    assert not finding("OpenCV").is_good


def test_two_wheels_are_a_fault_even_while_contrib_works(monkeypatch):
    install_opencv(monkeypatch, "opencv-contrib-python-headless", "opencv-python")
    both = finding("OpenCV")
    assert not both.is_good
    assert "opencv-contrib-python-headless, opencv-python" in both.found


def test_opencv_from_elsewhere_is_good_while_contrib_works(monkeypatch):
    install_opencv(monkeypatch)
    assert finding("OpenCV").is_good
    assert "outside pip" in finding("OpenCV").found


def test_without_egl_the_remedy_is_the_line_to_type(monkeypatch):
    monkeypatch.setattr(doctor, "create_context", without_egl)
    missing = finding("OpenGL")
    assert not missing.is_good
    assert not missing.is_required, "pictures are drawn with rays then"
    assert REMEDY in missing.remedy


def test_cameras_that_may_not_be_opened_are_a_note(tmp_path, monkeypatch):
    assert doctor._cameras(tmp_path).found == "none"
    for name in ("video0", "video1"):
        (tmp_path / name).touch()
    assert doctor._cameras(tmp_path).found == f"{tmp_path}/video0, {tmp_path}/video1"

    opened = Path.open

    def refuse_the_second(path, *arguments):
        if path.name == "video1":
            raise PermissionError
        return opened(path, *arguments)

    monkeypatch.setattr(Path, "open", refuse_the_second)
    locked = doctor._cameras(tmp_path)
    assert not locked.is_good
    assert not locked.is_required
    assert locked.found.endswith("video1")
    assert "usermod" in locked.remedy


def test_the_command_prints_every_remedy_and_names_what_is_required(monkeypatch, capsys):
    findings = [
        Finding("Python", True, "3.11"),
        Finding("OpenCV", False, "contrib broken", "install it again"),
        Finding("Cameras", False, "no permission", "join the group", is_required=False),
    ]
    monkeypatch.setattr(doctor_cli, "examine", lambda: findings)
    with pytest.raises(FishlightError, match=r"^not ready: OpenCV \(see above\)$"):
        doctor_cli.doctor()
    printed = capsys.readouterr().out
    assert "install it again" in printed
    assert "join the group" in printed


def test_a_note_alone_is_no_failure(monkeypatch, capsys):
    note = Finding("Cameras", False, "no permission", "join the group", is_required=False)
    monkeypatch.setattr(doctor_cli, "examine", lambda: [note])
    doctor_cli.doctor()
    assert "note" in capsys.readouterr().out
