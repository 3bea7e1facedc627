"""`fishlight chart estimators`: what ways to estimate direct light are worth, and what is said."""

from collections import Counter
from collections.abc import Sequence
from pathlib import Path

from capture.arguments import Output
from capture.errors import InputError
from capture.output import refuse_existing, write_text
from capture.progress import progress
from lighting.measures.known import read_known, write_known
from render.claims import registry
from render.claims.contract import verdict
from render.claims.point_light import under, under_point_light
from render.comparison import convergence
from render.comparison.equal_time import pictures, truest
from render.comparison.scenes import comparison_scenes
from render.measures.chart import Case, as_csv, measuring_digest
from render.measures.chart_scenes import chart_maps, map_digest
from render.measures.truths import cases_of
from render.output.view import auto_exposure_ev, to_display

SIZE_PX = (200, 150)
SECONDS = 1.0
"""Time of each picture of the gallery."""
DEFAULT_MAPS = ("indoor", "outdoor", "low sun")
"""Of those that the chart of renderers has without files."""


def chart_estimators(
    *environments: Path, output: Output, fresh: bool = False, force: bool = False
) -> None:
    """Chart error against time of every estimator of direct light, and test what is said of them.

    Three scenes, diffuse, glossy and mixed, under each map, in pictures of 200×150. Error is
    relative RMSE against a reference picture. Claims of the literature are measured again and said
    to be confirmed or not. A gallery shows what each estimator draws in a second, and where that
    errs.

    Parameters
    ----------
    environments
        Lat-long maps, EXR or Radiance .hdr. Without any, those of the bundled recordings and a made
        one with a low sun.
    output
        Folder for estimators-light and estimators-dark, each as .svg and .png, estimators.csv,
        claims.csv and claims.txt, gallery.html, and what later runs take from this one: reference
        pictures and measurements.
    fresh
        Measure everything again.
    force
        Replace the charts of an earlier run.
    """
    # Here, so that no other command waits a second for matplotlib.
    from lighting.measures.line_chart import draw
    from render.comparison.convergence_drawing import CONVERGENCE_CHART
    from render.comparison.gallery import Section, gallery

    if output.exists() and not output.is_dir():
        raise InputError(f"{output} is a file; give --output a folder")
    drawn = {
        output / f"estimators-{theme}{suffix}": theme
        for theme in ("light", "dark")
        for suffix in (".svg", ".png")
    }
    table, page = output / "estimators.csv", output / "gallery.html"
    told = [output / "claims.csv", output / "claims.txt"]
    for path in (*drawn, table, page, *told):
        refuse_existing(path, force=force)
    maps = chart_maps(environments)
    if not environments:
        maps = {name: maps[name] for name in DEFAULT_MAPS if name in maps}
    cases = cases_of(comparison_scenes(SIZE_PX), maps, output / "references")

    output.mkdir(parents=True, exist_ok=True)
    digest = measuring_digest()
    rows = _measured(cases, output / "measurements.json", digest, fresh=fresh)
    of_maps = " ".join([digest, *map(map_digest, maps.values())])
    found_path = output / "findings.json"
    found = {} if fresh else read_known(found_path, registry.Findings, digest)
    checking = registry.check(registry.CLAIMS, maps, of_maps, found)
    try:
        checked = list(progress(checking, "claims", len(registry.CLAIMS)))
    finally:
        write_known(found_path, found)
    write_text(table, as_csv(rows))
    write_text(told[0], registry.as_csv(checked))
    write_text(told[1], registry.as_text(checked))

    about = (
        f"{len(maps)} map{'' if len(maps) == 1 else 's'}: {', '.join(maps)}; "
        f"pictures of {SIZE_PX[0]}×{SIZE_PX[1]}."
    )
    for path, theme in drawn.items():
        draw(convergence.points_of(rows), CONVERGENCE_CHART, convergence.systems(), about, path,
             theme)  # fmt: skip
    sections = [
        Section(
            case.scene_name,
            case.map_name,
            case.truth().radiance,
            list(pictures(case, convergence.systems(), SECONDS)),
        )
        for case in progress(cases, "gallery")
    ]
    charts = {
        theme: path.read_text(encoding="utf-8")
        for path, theme in drawn.items()
        if path.suffix == ".svg"
    }
    lit = {"a point light": under_point_light()}
    lit |= {f"the map “{name}”": under(environment) for name, environment in maps.items()}
    strips = {name: to_display(seen, auto_exposure_ev(seen)) for name, seen in lit.items()}
    at = f"{about} Each picture took at most {SECONDS:g} s, or four passes."
    write_text(page, gallery(sections, checked, charts, strips, at))
    print(f"{output}: {len(rows)} measurements of {len(convergence.systems())} estimators")
    best = Counter(truest(each.shown).estimator for each in sections)
    wins = ", ".join(f"{name} in {count}" for name, count in best.most_common())
    print(f"truest at equal time, of {len(sections)} cases: {wins}; claims:")
    for claim, findings in checked:
        print(f"  {claim.name}: {verdict(findings)}")


def _measured(
    cases: Sequence[Case], path: Path, digest: str, *, fresh: bool
) -> list[convergence.Convergence]:
    """Return all measurements; an interrupted run leaves those that it made."""
    known = {} if fresh else read_known(path, convergence.Convergence, digest)
    names = convergence.systems()
    measuring = convergence.measure(cases, names, convergence.SAMPLES, known)
    jobs = len(cases) * len(names) * len(convergence.SAMPLES)
    try:
        return [row for row in progress(measuring, "errors", jobs) if row]
    finally:
        write_known(path, known)
