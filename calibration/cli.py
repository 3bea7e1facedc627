"""The calibration stage's commands. They are named, and imported only when one is called."""

COMMANDS: tuple[tuple[str, str], ...] = (
    ("calibration.calibrate_cli:calibrate_app", "calibrate"),
    ("calibration.report_cli:report", "report"),
)
