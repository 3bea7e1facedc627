"""How many frames of a bracket are decoded at a time."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from capture.frame import Exposure
from capture.recording import open_recording
from capture.recording_writer import create_recording
from capture.sensor import assumed_sensor


@pytest.mark.parametrize(("cores", "decoders"), [(1, 1), (2, 1), (4, 3), (64, 3)])
def test_a_stream_leaves_a_core_to_whoever_takes_it(tmp_path, monkeypatch, cores, decoders):
    counts = np.full((4, 6, 3), 100, np.uint8)
    with create_recording(tmp_path / "r", "test", assumed_sensor(counts.dtype)) as writer:
        for time_s in (0.01, 0.1, 1.0):
            writer.write_frame(counts, Exposure(time_s), 0.0, 0)
    pools = []

    class Pool(ThreadPoolExecutor):
        def __init__(self, most):
            pools.append(most)
            super().__init__(most)

    monkeypatch.setattr("capture.recording.ThreadPoolExecutor", Pool)
    monkeypatch.setattr("os.cpu_count", lambda: cores)
    (bracket,) = open_recording(tmp_path / "r")
    assert pools == [decoders]
    assert [frame.exposure.time_s for frame in bracket.frames] == [0.01, 0.1, 1.0]
