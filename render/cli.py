"""The render stage's commands. They are named, and imported only when one is called."""

COMMANDS: tuple[tuple[str, str], ...] = (
    ("render.render_cli:render", "render"),
    ("render.composite_cli:composite_command", "composite"),
    ("render.replay_cli:replay_command", "replay"),
    ("render.batch_cli:batch", "batch"),
    ("render.live_cli:live", "live"),
    ("render.follow_cli:follow_command", "follow"),
    ("render.chart_cli:chart_render", "chart render"),
    ("render.estimators_chart_cli:chart_estimators", "chart estimators"),
    ("render.doctor_cli:doctor", "doctor"),
)
