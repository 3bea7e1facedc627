"""Brackets of known response: a smooth scene of wide range, and three curves unlike each other."""

import cv2
import numpy as np

from capture.frame import Bracket, Exposure
from capture.sensor import Sensor, srgb_decode
from tests.capture.simulated_bracket import record

SIDE_PX = 256
COUNTS = np.arange(256) / 255.0


def _film():
    """Linear values of a curve with a toe and a shoulder, of no form that the project fits."""
    light = np.linspace(0.0, 1.0, 20001)
    coded = light**0.9 / (light**0.9 + 0.18**0.9) * (1 + 0.18**0.9)
    return np.interp(COUNTS, coded**1.25, light)


CURVES = {"srgb": srgb_decode(COUNTS), "gamma": COUNTS**2.2, "film": _film()}


def true_sensor(name):
    return Sensor(0.0, 255.0, response=np.repeat(CURVES[name][:, None], 3, axis=1), source=name)


def scene(seed=0, stops=12.0):
    """Radiance (256, 256, 3) below 1, spread evenly over `stops`, smooth over eight pixels."""
    rng = np.random.default_rng(seed)
    texture = cv2.GaussianBlur(rng.normal(0, 1, (SIDE_PX, SIDE_PX, 3)), (0, 0), 24)
    order = texture.reshape(-1, 3).argsort(axis=0).argsort(axis=0).reshape(texture.shape)
    return 2.0 ** (-stops * order / order.max())


def exposures(count=5, step_ev=2.0):
    return [Exposure(2.0 ** (step_ev * k)) for k in range(count)]


def bracket(name, seed=0, radiance=None, times=None):
    radiance = scene(seed) if radiance is None else radiance
    rng = np.random.default_rng([seed, 1])
    return record(radiance, times or exposures(), true_sensor(name), rng)


def error_ev(curve, name, counts=slice(20, 241)):
    """Return log2 of an estimated over the true curve, both held at count 128, (counts, 3)."""
    true = np.repeat(CURVES[name][:, None], 3, axis=1)
    return np.log2(curve.values[counts] / curve.values[128] / (true[counts] / true[128]))


def relabelled(original: Bracket, log2_errors):
    """Return the bracket with labels that are wrong by so many stops."""
    frames = [
        type(frame)(frame.counts, Exposure(frame.exposure.time_s * 2.0**error), index=frame.index)
        for frame, error in zip(original.frames, log2_errors, strict=True)
    ]
    return Bracket(tuple(frames))
