"""The standard error beside a picture by an estimator: as large as what the picture errs by."""

import math

import numpy as np
import pytest

from render.estimators.passes import passes_of
from render.estimators.registry import UNBIASED
from render.reference.accumulation import mean_and_variance, nothing_yet
from render.scenes.default_scene import default_scene
from tests.render import estimator_scene

PICTURES, PASSES = 8, 24


@pytest.mark.slow
@pytest.mark.parametrize("name", sorted(UNBIASED))
def test_the_standard_error_is_true_within_a_tenth(name):
    scene, camera = default_scene((16, 12))
    pictures, variances = [], []
    with passes_of(name, scene, camera, estimator_scene.uneven_map(rows=16)) as add:
        for picture in range(PICTURES):
            progress = nothing_yet(camera.size_px)
            for number in range(PASSES):
                add(picture * PASSES + number, 1, progress.sums)
            progress.passes = PASSES
            mean, variance = mean_and_variance(progress)
            pictures.append(mean[..., :3])
            variances.append(variance)
    mean, variance = np.mean(pictures, axis=0), np.array(variances)
    told, seen = variance.mean(axis=0), np.var(pictures, axis=0, ddof=1)
    noisy = told > 1e-5 * mean**2
    assert noisy.mean() > 0.7  # the others' light is known as good as exactly
    # Each pixel counts alike: in a few, where light is met rarely, lies most of the variance.
    assert math.sqrt(np.mean(seen[noisy] / told[noisy])) == pytest.approx(1, abs=0.1)

    # Each picture against the mean of the others, which has an error too.
    others = PICTURES - 1
    off = (np.array(pictures) - mean) * PICTURES / others
    squared = variance + (variance.sum(axis=0) - variance) / others**2
    known = noisy & (variance > 0)
    # Student's t of 23 degrees of freedom has a standard deviation of 1.05.
    assert (off[known] / np.sqrt(squared[known])).std() == pytest.approx(1, abs=0.1)
