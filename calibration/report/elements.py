"""Parts of HTML that the report is made of."""

from collections.abc import Sequence
from html import escape
from importlib.resources import files

from calibration.report.theme import DARK, LIGHT, css_variables


def document(title: str, parts: Sequence[str], css: str = "") -> str:
    """Return a page that needs no other file, in the colours of a report; `css` adds to its own."""
    own = files("calibration.report").joinpath("page.css").read_text(encoding="utf-8")
    return f"""<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta name="color-scheme" content="light dark">
<title>{escape(title)}</title>
<style>
:root {{ {css_variables(LIGHT)} }}
@media screen and (prefers-color-scheme: dark) {{ :root {{ {css_variables(DARK)} }} }}
{own}{css}</style>
</head>
<body>
<main>
{"".join(parts)}</main>
</body>
</html>
"""


def section(name: str, heading: str, body: str) -> str:
    """Return a part of the page under a heading, to which #`name` leads."""
    return (
        f'<section id="{name}" aria-labelledby="{name}-heading">\n'
        f'<h2 id="{name}-heading">{heading}</h2>\n{body}\n</section>\n'
    )


def table(caption: str, headings: Sequence[str], rows: Sequence[str]) -> str:
    """Return a table, which scrolls by itself where the page is narrow."""
    head = "".join(f'<th scope="col">{heading}</th>' for heading in headings)
    told = f"<caption>{caption}</caption>" if caption else ""
    return (
        f'<div class="wide"><table>{told}\n<thead><tr>{head}</tr></thead>\n'
        f"<tbody>\n{''.join(rows)}</tbody></table></div>"
    )


def row(cells: Sequence[str], kind: str = "") -> str:
    """Return a table's row; its first cell is its heading."""
    first, *rest = (escape(cell) for cell in cells)
    others = "".join(f"<td>{cell}</td>" for cell in rest)
    marked = f' class="{kind}"' if kind else ""
    return f'<tr{marked}><th scope="row">{first}</th>{others}</tr>\n'
