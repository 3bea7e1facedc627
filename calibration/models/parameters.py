"""A camera model as a vector of numbers, for what estimates them.

Domain : every field of the model in the order of its declaration, a tuple's values one by one: a
focal length given as one number is one parameter, (fx, fy) are two.
"""

from dataclasses import fields, replace
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from calibration.camera import CameraModel
from capture.errors import InputError

Model = TypeVar("Model", bound=CameraModel)

LARGEST = 1e12
"""No camera has a number beyond it, and powers of such ones overflow."""


def parameters(model: CameraModel) -> NDArray[np.float64]:
    """Return the model's parameters (P,)."""
    values = [np.ravel(getattr(model, field.name)) for field in fields(model)]
    return np.concatenate(values).astype(np.float64)


def check_parameters(model: CameraModel) -> None:
    """Raise InputError if a parameter is beyond what any camera has."""
    if not np.all(np.abs(parameters(model)) <= LARGEST):
        raise InputError(f"a number of the lens is beyond {LARGEST:g}, as of no camera")


def with_parameters(model: Model, values: NDArray[np.floating]) -> Model:
    """Return the model with its parameters replaced by `values` (P,).

    Raises
    ------
    InputError
        If no such model can be, for example where a focal length is negative.
    """
    changes: dict[str, object] = {}
    start = 0
    for field in fields(model):
        old = getattr(model, field.name)
        end = start + np.size(old)
        new = np.reshape(values[start:end], np.shape(old)).tolist()
        changes[field.name] = tuple(new) if np.ndim(old) else new
        start = end
    return replace(model, **changes)
