"""Colours of the report on light and dark pages, and figures that take them from the page.

A figure is drawn once in the light colours. As a picture of its own it keeps them; within the page
each becomes a CSS variable that the page sets, so that the same drawing serves both.
"""

import html
import io
import re
from typing import Any

import matplotlib as mpl
from matplotlib.figure import Figure

# After the colours of M. Okabe and K. Ito, "Color Universal Design", 2008, which colour-blind eyes
# tell apart; darker on white and lighter on black where they would be faint.
LIGHT = {
    "page": "#ffffff",
    "panel": "#f6f8fa",
    "ink": "#1f2328",
    "muted": "#59636e",
    "grid": "#d8dee4",
    "blue": "#0072b2",
    "red": "#c44e00",
    "green": "#007a5a",
    "amber": "#b07800",
}
DARK = {
    "page": "#0d1117",
    "panel": "#161b22",
    "ink": "#e6edf3",
    "muted": "#9198a1",
    "grid": "#30363d",
    "blue": "#4ea8e0",
    "red": "#f0803c",
    "green": "#2fc39a",
    "amber": "#f0b93a",
}

SETTINGS: dict[Any, Any] = {
    "svg.fonttype": "none",
    "font.family": "DejaVu Sans",
    "font.size": 9,
    "text.color": LIGHT["ink"],
    "axes.labelcolor": LIGHT["ink"],
    "axes.edgecolor": LIGHT["grid"],
    "axes.facecolor": LIGHT["page"],
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": LIGHT["grid"],
    "grid.linewidth": 0.6,
    "xtick.color": LIGHT["muted"],
    "ytick.color": LIGHT["muted"],
    "legend.facecolor": LIGHT["page"],
    "legend.edgecolor": LIGHT["page"],
    "figure.facecolor": LIGHT["page"],
}
"""Of matplotlib, for every figure of the report."""

_PNG_DPI = 220


def css_variables(colours: dict[str, str]) -> str:
    """Return the declarations that set the page's colours."""
    return " ".join(f"--{name}: {colour};" for name, colour in colours.items())


def inline_svg(figure: Figure, name: str, description: str) -> str:
    """Return a figure as an <svg> element in the page's colours, as wide as there is room.

    `name` keeps what its parts refer to apart from the parts of other figures; `description` is
    read out in its place.
    """
    written = io.StringIO()
    with mpl.rc_context(SETTINGS | {"svg.hashsalt": name}):
        figure.savefig(written, format="svg", metadata={"Date": None})
    text = written.getvalue()
    text = text[text.index("<svg") :]
    text = re.sub(r"<metadata>.*?</metadata>", "", text, flags=re.DOTALL)
    # matplotlib numbers its groups alike in every figure: ids that nothing refers to.
    text = re.sub(r'(<g) id="[^"]*"', r"\1", text)
    for colour_name, colour in LIGHT.items():
        text = text.replace(colour, f"var(--{colour_name})")
    view_box = re.search(r'viewBox="[^"]*"', text)
    assert view_box is not None
    opening = f'<svg role="img" aria-label="{html.escape(description)}" {view_box[0]}>'
    return opening + text[text.index(">") + 1 :]


def png(figure: Figure) -> bytes:
    """Return a figure as a PNG file in the light colours."""
    written = io.BytesIO()
    with mpl.rc_context(SETTINGS):
        figure.savefig(written, format="png", dpi=_PNG_DPI)
    return written.getvalue()
