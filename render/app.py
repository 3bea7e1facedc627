"""The `fishlight` application: every stage's commands under one name."""

from importlib.metadata import version

from cyclopts import App, Parameter

import calibration.cli
import capture.cli
import lighting.cli
import render.cli

app = App(
    name="fishlight",
    help="Turns a fisheye or mirror-ball camera into the lights of a rendered scene.",
    version=lambda: version("fishlight"),
    default_parameter=Parameter(negative=""),
)
for stage in (capture.cli, calibration.cli, lighting.cli, render.cli):
    for command, name in stage.COMMANDS:
        app.command(command, name=name)
