"""`fishlight calibrate`: a sub-command for each thing that is estimated."""

from cyclopts import App

from calibration.response_cli import calibrate_response

calibrate_app = App(
    name="calibrate", help="Estimate what a camera does to light, from its own pictures."
)
calibrate_app.command(calibrate_response, name="response")
