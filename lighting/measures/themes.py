"""Colours of charts for light and for dark pages."""

from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Theme:
    """Colours of a page, and of lines on it: of compared systems, of others, and the best."""

    page: str
    ink: str
    grid: str
    peer: str
    other: str
    colours: tuple[str, ...]


# After the colours of M. Okabe and K. Ito, "Color Universal Design", 2008, which colour-blind eyes
# tell apart; darker on white and lighter on black where they would be faint.
THEMES = {
    "light": Theme(
        "#ffffff", "#1f2328", "#e4e8ec", "#7d858e", "#a9c4da",
        ("#d55e00", "#0072b2", "#008060", "#b5518e", "#b07800"),
    ),
    "dark": Theme(
        "#0d1117", "#e6edf3", "#232a33", "#8b949e", "#36556d",
        ("#f0803c", "#4ea8e0", "#2fc39a", "#e39ac6", "#f0b93a"),
    ),
}  # fmt: skip


def settings_of(colours: Theme) -> dict[Any, Any]:
    """Return matplotlib's settings; ids are fixed, so that the same points give the same file."""
    return {
        "svg.hashsalt": "fishlight",
        "svg.fonttype": "none",
        "font.family": "DejaVu Sans",
        "font.size": 9,
        "text.color": colours.ink,
        "axes.labelcolor": colours.ink,
        "axes.edgecolor": colours.grid,
        "xtick.color": colours.ink,
        "ytick.color": colours.ink,
    }
