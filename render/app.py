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

_GROUPS = {"chart": "Measure ways to do a stage's work, and draw what they are worth."}
"""What commands of several stages stand under, as "chart lights" does, and its help."""


def _mount(command: str, name: str) -> None:
    """Put a command of a stage under the application or one of its groups."""
    *above, last = name.split()
    place = app
    for group in above:
        if group not in place:
            place.command(App(name=group, help=_GROUPS[group]))
        place = place[group]
    place.command(command, name=last)


for stage in (capture.cli, calibration.cli, lighting.cli, render.cli):
    for command, name in stage.COMMANDS:
        _mount(command, name)
