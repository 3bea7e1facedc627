"""`fishlight chart render`: what ways to a picture are worth, measured here and drawn."""

from collections.abc import Iterable, Mapping
from pathlib import Path
from statistics import median
from typing import Annotated, TypeVar

import msgspec
from cyclopts import Parameter

from capture.arguments import Output
from capture.errors import InputError
from capture.output import refuse_existing, write_text
from capture.progress import progress
from lighting.measures.known import read_known, write_known
from render.measures import chart, growth
from render.measures.chart_scenes import chart_maps, chart_scenes
from render.measures.truths import cases_of
from render.measures.ways import MAIN_WAYS, SHADOW_MAPS, ways

SIZE_PX = (640, 480)

Row = TypeVar("Row", bound=msgspec.Struct)


def chart_render(
    *environments: Path,
    output: Output,
    mesh: Annotated[tuple[Path, ...], Parameter(consume_multiple=True)] = (),
    fresh: bool = False,
    force: bool = False,
) -> None:
    """Chart error against time of every way to a picture, with 4 to 1024 lights.

    Error is that against a reference picture under the whole map, in a picture of 640×480 without
    its outlines: relative RMSE, and FLIP, which tells how different it looks. A second chart shows
    how the time of a frame grows with lights, triangles and pixels. All this takes about 25 minutes
    on two idle cores; a run that was ended goes on where it was.

    Parameters
    ----------
    environments
        Lat-long maps, EXR or Radiance .hdr. Without any, those of the bundled recordings and three
        made ones.
    output
        Folder for render-light and render-dark, growth-light and growth-dark, each as .svg and
        .png, render.csv and growth.csv with every number, and what later runs take from this one:
        reference pictures and measurements.
    mesh
        OBJ, glTF, GLB or PLY files, each a scene; three made scenes without any.
    fresh
        Measure everything again.
    force
        Replace the charts of an earlier run.
    """
    # Here, so that no other command waits a second for matplotlib.
    from lighting.measures.line_chart import draw
    from render.measures.chart_drawing import ERROR_CHART, GROWTH_CHART

    if output.exists() and not output.is_dir():
        raise InputError(f"{output} is a file; give --output a folder")
    pictures = [
        (output / f"{name}-{theme}{suffix}", theme, what)
        for name, what in (("render", ERROR_CHART), ("growth", GROWTH_CHART))
        for theme in ("light", "dark")
        for suffix in (".svg", ".png")
    ]
    tables = [output / "render.csv", output / "growth.csv"]
    for path in (*(path for path, *_ in pictures), *tables):
        refuse_existing(path, force=force)
    maps, scenes = chart_maps(environments), chart_scenes(mesh, SIZE_PX)

    output.mkdir(parents=True, exist_ok=True)
    known_path, grown_path = output / "measurements.json", output / "growth.json"
    digest = chart.measuring_digest()
    known = {} if fresh else read_known(known_path, chart.Measurement, digest)
    grown = {} if fresh else read_known(grown_path, growth.Growth, digest)
    with ways() as compared:
        if SHADOW_MAPS not in compared:
            print("no OpenGL, so not in the chart: shadow maps")
        cases = cases_of(scenes, maps, output / "references")
        counts = {
            name: chart.COUNTS if name in MAIN_WAYS else chart.COUNTS_OF_SETTINGS
            for name in compared
        }
        on_cases = chart.measure(cases, compared, counts, known)
        main_ways = {name: way for name, way in compared.items() if name in MAIN_WAYS}
        growing = growth.measure(next(iter(maps.values())), main_ways, grown)
        jobs = len(cases) * sum(map(len, counts.values()))
        growth_jobs = len(main_ways) * sum(map(len, growth.COUNTS.values()))
        rows = _saved(progress(on_cases, "errors", jobs), known_path, known)
        grew = _saved(progress(growing, "growth", growth_jobs), grown_path, grown)

    write_text(tables[0], chart.as_csv(rows))
    write_text(tables[1], chart.as_csv(grew))
    points = chart.points_of(rows) + growth.points_of(grew)
    about = {
        ERROR_CHART: f"{_all_of(scenes, 'scene')} under {_all_of(maps, 'map')}, "
        f"{SIZE_PX[0]}×{SIZE_PX[1]}. "
        f"The reference's own noise has a FLIP of {median(row.least_flip for row in rows):.1%}.",
        GROWTH_CHART: "With lights: medians over the other chart's scenes and maps. Otherwise "
        f"{growth.LIGHTS} lights of {Path(next(iter(maps))).name}; a ball of so many triangles, "
        "the default scene in so many pixels.",
    }
    for path, theme, what in pictures:
        draw(points, what, MAIN_WAYS, about[what], path, theme)
    print(
        f"{output}: {len(rows) + len(grew)} measurements of {len(compared)} ways, "
        f"{_all_of(scenes, 'scene')} under {_all_of(maps, 'map')}"
    )


def _saved(rows: Iterable[Row | None], path: Path, known: dict[str, Row]) -> list[Row]:
    """Return the rows there are; each is in the file before the next is measured.

    So a run that was interrupted, in whatever way, goes on where it was.
    """
    found, saved = [], len(known)
    for row in rows:
        if len(known) > saved:
            write_known(path, known)
            saved = len(known)
        if row is not None:
            found.append(row)
    return found


def _all_of(things: Mapping[str, object], kind: str) -> str:
    return f"{len(things)} {kind}{'' if len(things) == 1 else 's'}"
