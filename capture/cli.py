"""The capture stage's commands. They are named, and imported only when one is called."""

COMMANDS: tuple[tuple[str, str], ...] = (
    ("capture.record_cli:record_command", "record"),
    ("capture.import_cli:import_", "import"),
    ("capture.inspect_cli:inspect", "inspect"),
    ("capture.merge_cli:merge", "merge"),
)
