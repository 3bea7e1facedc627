"""`fishlight calibrate`: a sub-command for each thing that is estimated, and for exchange."""

from cyclopts import App

from calibration.ball_cli import calibrate_ball
from calibration.colour_cli import calibrate_colour
from calibration.formats_cli import export_calibration, import_calibration
from calibration.lens_cli import calibrate_lens
from calibration.response_cli import calibrate_response
from calibration.sun_cli import calibrate_sun
from calibration.up_cli import calibrate_up
from calibration.vignetting_cli import calibrate_vignetting

calibrate_app = App(
    name="calibrate",
    help="Estimate how a camera sees from its own pictures, or take it from a file.",
)
calibrate_app.command(calibrate_lens, name="lens")
calibrate_app.command(calibrate_ball, name="ball")
calibrate_app.command(calibrate_response, name="response")
calibrate_app.command(calibrate_colour, name="colour")
calibrate_app.command(calibrate_sun, name="sun")
calibrate_app.command(calibrate_up, name="up")
calibrate_app.command(calibrate_vignetting, name="vignetting")
calibrate_app.command(import_calibration, name="import")
calibrate_app.command(export_calibration, name="export")
