"""Pictures that are interrupted and continued: the same as if they had not been."""

import math
import signal
import subprocess
import sys

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from capture.exr import read_exr
from lighting.light_files import write_lights
from lighting.maps.environment import EnvironmentMap
from lighting.maps.environment_files import write_environment
from render import reference_cli
from render.reference import accumulation
from render.reference.accumulation import (
    LEAST_PASSES,
    accumulate,
    mean_and_variance,
    nothing_yet,
)
from render.reference.checkpoint import checkpoint_of, read_checkpoint, write_checkpoint
from render.reference.digest import digest_of
from render.reference.sampled_light import Rays
from render.reference.tracing import render_reference
from render.render_cli import render
from render.scenes.default_scene import default_scene
from tests.render.light_sets import random_lights

FEW = {"spent": Rays(2, 4, 2), "pool_size": 1 << 12, "error": 0.04}


KILLED_AT = """
import os, signal, sys
from render import reference_cli
from render.main import main

def die_or_write(path, progress, digest, write=reference_cli.write_checkpoint):
    if progress.drawn > {last}:
        os.kill(os.getpid(), signal.SIGKILL)
    write(path, progress, digest)

reference_cli.KEPT_EVERY_S = -1.0
reference_cli.write_checkpoint = die_or_write
main()
"""


class Killed(BaseException):
    pass


def lit_map(rows=16):
    radiance = np.random.default_rng(0).random((rows, 2 * rows, 3)).astype(np.float32) ** 8
    seen = np.ones((rows, 2 * rows), bool)
    return EnvironmentMap(radiance, seen, ~seen)


def noise(number, factor, sums):
    """A pass: a picture of 1 with an error of 1 / √factor."""
    values = 1 + np.random.default_rng([7, number]).normal(0, factor**-0.5, sums.radiance.shape)
    sums.radiance[:] += values
    sums.squares[:] += values**2


@pytest.mark.parametrize("share", [0.1, 0.5, 0.9])
def test_a_picture_killed_at_any_share_of_its_passes_is_the_one_that_would_have_been(
    tmp_path, share
):
    scene, camera = default_scene((24, 18))
    light, path = lit_map(), tmp_path / "p.exr.unfinished"
    whole = nothing_yet(camera.size_px)
    uninterrupted = render_reference(scene, camera, light, progress=whole, **FEW)
    last = max(1, int(share * whole.drawn))
    assert last < whole.drawn

    def kill(progress):
        write_checkpoint(path, progress, "it")
        if progress.drawn == last:
            raise Killed

    with pytest.raises(Killed):
        render_reference(scene, camera, light, on_pass=kill, **FEW)
    kept = read_checkpoint(path, "it")
    assert kept.drawn == last
    drawn = []
    continued = render_reference(
        scene, camera, light, progress=kept, on_pass=lambda now: drawn.append(now.drawn), **FEW
    )
    assert drawn == list(range(last + 1, whole.drawn + 1))
    assert_array_equal(continued.radiance, uninterrupted.radiance)
    assert_array_equal(continued.standard_error, uninterrupted.standard_error)
    assert continued.shadow_rays == uninterrupted.shadow_rays
    assert continued.passes == uninterrupted.passes
    assert continued.relative_error == uninterrupted.relative_error


def test_the_error_of_interrupted_pictures_is_true(tmp_path):
    def killed(now):
        if now.drawn == 2:
            write_checkpoint(tmp_path / "p", now, "it")
            raise Killed

    progress = nothing_yet((60, 40))
    with pytest.raises(Killed):
        accumulate(noise, progress, error=0.1, most_factor=4, on_pass=killed)
    progress = read_checkpoint(tmp_path / "p", "it")
    accumulate(noise, progress, error=0.1, most_factor=4)
    mean, variance = mean_and_variance(progress)
    assert math.sqrt(variance.mean() / ((mean[..., :3] - 1) ** 2).mean()) == pytest.approx(
        1, abs=0.1
    )
    assert progress.relative_error == pytest.approx(np.sqrt(variance.mean()), rel=0.01)


def test_passes_grow_once_and_those_before_do_not_count():
    progress, told = nothing_yet((40, 30)), []
    accumulate(
        noise, progress, error=0.05, most_factor=64,
        on_pass=lambda now: told.append((now.drawn, now.passes, now.factor)),
    )  # fmt: skip
    assert progress.relative_error <= 0.05
    # An error of 1/√4 after 4 passes: 400 are wanted, so those that are aimed at have 32 times as
    # many rays, and 0.05² = 1/(32 n) at n = 12.5.
    assert [step for step in told if step[2] == 1] == [(n, n, 1) for n in range(1, 5)]
    assert told[4:] == [(4 + n, n, 32) for n in range(1, len(told) - 3)]
    assert 10 < progress.passes < 16
    assert progress.sums.radiance.mean() / progress.passes == pytest.approx(1, abs=0.01)


def test_passes_do_not_grow_beyond_some_seconds(monkeypatch):
    monkeypatch.setattr(accumulation, "_LONGEST_PASS_S", 0.0)
    progress = nothing_yet((40, 30))
    accumulate(noise, progress, error=0.2, most_factor=64)
    assert progress.factor == 1
    assert progress.passes > 20


def test_a_picture_lost_in_its_noise_has_no_relative_error():
    def speck(number, factor, sums):  # one pass in four has something in one pixel
        sums.radiance[0, 0, :3] += number == 2
        sums.squares[0, 0, :3] += number == 2

    progress = nothing_yet((2, 2))
    accumulate(speck, progress, error=0.1, seconds=0.0)
    assert progress.passes == LEAST_PASSES
    assert progress.relative_error == math.inf


def test_a_black_picture_is_known():
    progress = nothing_yet((2, 2))
    accumulate(lambda *_: None, progress, error=0.1)
    assert progress.passes == LEAST_PASSES
    assert progress.relative_error == 0


def test_the_time_counts_from_before_the_interruption():
    progress = nothing_yet((4, 4))
    progress.elapsed_s = 1e6
    accumulate(noise, progress, error=0.0, seconds=1e3)
    assert progress.passes == LEAST_PASSES


@pytest.mark.parametrize("damage", ["cut", "empty", "text", "other"])
def test_a_checkpoint_that_is_damaged_or_of_another_picture_is_none(tmp_path, damage):
    path = tmp_path / "p.exr.unfinished"
    write_checkpoint(path, nothing_yet((4, 4)), "it")
    assert read_checkpoint(path, "it").sums.radiance.shape == (4, 4, 4)
    whole = path.read_bytes()
    changed = {"cut": whole[: len(whole) // 2], "empty": b"", "text": b"no picture", "other": whole}
    path.write_bytes(changed[damage])
    assert read_checkpoint(path, "another" if damage == "other" else "it") is None
    assert read_checkpoint(tmp_path / "none", "it") is None


def test_digests_tell_pictures_apart():
    scene, camera = default_scene((24, 18))
    same = default_scene((24, 18))
    assert digest_of(scene, camera, lit_map()) == digest_of(*same, lit_map())
    brighter = lit_map()
    brighter = EnvironmentMap(2 * brighter.radiance, brighter.valid, brighter.clipped)
    others = [
        (scene, default_scene((24, 19))[1], lit_map()),
        (type(scene)(scene.meshes[1:], scene.ground), camera, lit_map()),
        (scene, camera, brighter),
        (scene, camera, lit_map(), "cosine"),
    ]
    digests = {digest_of(*other) for other in others} | {digest_of(scene, camera, lit_map())}
    assert len(digests) == 5


def test_the_command_goes_on_and_leaves_only_the_picture(tmp_path, monkeypatch, capsys):
    write_lights(tmp_path / "lights.json", random_lights(4, seed=0))
    output = tmp_path / "p.exr"
    arguments = {"reference": True, "lights": tmp_path / "lights.json", "size": "16x12"}
    render(output=tmp_path / "whole.exr", error=0.5, **arguments)
    monkeypatch.setattr(reference_cli, "KEPT_EVERY_S", 0.0)
    write = reference_cli.write_checkpoint

    def write_and_die(path, progress, digest):
        write(path, progress, digest)
        if progress.passes == 3:
            raise Killed

    monkeypatch.setattr(reference_cli, "write_checkpoint", write_and_die)
    with pytest.raises(Killed):
        render(output=output, error=0.5, **arguments)
    assert checkpoint_of(output).is_file()
    assert not output.exists()
    monkeypatch.setattr(reference_cli, "write_checkpoint", write)
    capsys.readouterr()
    render(output=output, error=0.5, **arguments)
    assert "goes on from pass 3\n" in capsys.readouterr().out
    assert {path.name for path in tmp_path.iterdir()} == {"lights.json", "p.exr", "whole.exr"}
    for name, channel in read_exr(output).channels.items():
        assert_array_equal(channel, read_exr(tmp_path / "whole.exr").channels[name])


@pytest.mark.slow
@pytest.mark.parametrize("estimator", [None, "mis-power", "irradiance-cache"])
def test_a_process_killed_at_nine_tenths_goes_on_to_the_same_bits(
    tmp_path, monkeypatch, capsys, estimator
):
    write_environment(tmp_path / "map.exr", lit_map())
    error = 0.03
    drawn = []
    monkeypatch.setattr(reference_cli, "KEPT_EVERY_S", -1.0)
    write = reference_cli.write_checkpoint

    def count_and_write(path, progress, digest):
        drawn.append(progress.drawn)
        write(path, progress, digest)

    monkeypatch.setattr(reference_cli, "write_checkpoint", count_and_write)

    def draw(output):
        render(
            reference=True, environment=tmp_path / "map.exr", size="24x18", estimator=estimator,
            error=error, output=output,
        )  # fmt: skip

    draw(tmp_path / "whole.exr")
    last = int(0.9 * drawn[-1])
    assert 4 < last < drawn[-1]

    output = tmp_path / "p.exr"
    command = [sys.executable, "-c", KILLED_AT.format(last=last), "render", "--reference"]
    command += ["--map", str(tmp_path / "map.exr"), "--size", "24x18", "--error", str(error)]
    command += ["-o", str(output), *(["--estimator", estimator] if estimator else [])]
    ended = subprocess.run(command, capture_output=True, text=True, timeout=300)
    assert ended.returncode == -signal.SIGKILL, ended.stderr
    assert not output.exists()

    passes = drawn.copy()
    drawn.clear()
    capsys.readouterr()
    draw(output)
    assert "goes on from pass " in capsys.readouterr().out
    assert drawn == passes[last:]
    for name, channel in read_exr(output).channels.items():
        assert_array_equal(channel, read_exr(tmp_path / "whole.exr").channels[name])
