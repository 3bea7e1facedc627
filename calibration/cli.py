"""The calibration stage's commands: calibrate, with a sub-command for each thing estimated."""

from collections.abc import Callable
from typing import Any

from cyclopts import App

from calibration.response_cli import calibrate_response

calibrate_app = App(help="Estimate what a camera does to light, from its own pictures.")
calibrate_app.command(calibrate_response, name="response")

COMMANDS: tuple[tuple[Callable[..., Any], str], ...] = ((calibrate_app, "calibrate"),)
