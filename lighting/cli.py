"""The lighting stage's commands. They are named, and imported only when one is called."""

COMMANDS: tuple[tuple[str, str], ...] = (
    ("lighting.simulate_cli:simulate", "simulate"),
    ("lighting.remap_cli:remap", "remap"),
    ("lighting.combine_cli:combine", "combine"),
    ("lighting.absolute_cli:scale", "scale"),
    ("lighting.absolute_cli:recover", "recover"),
    ("lighting.absolute_cli:illuminance", "illuminance"),
    ("lighting.lights_cli:lights", "lights"),
    ("lighting.export_cli:export", "export"),
    ("lighting.chart_cli:chart_lights", "chart lights"),
    ("lighting.sequence_chart_cli:chart_sequence", "chart sequence"),
)
