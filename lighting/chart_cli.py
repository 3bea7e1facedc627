"""`fishlight chart lights`: what ways to find lights are worth, measured here and drawn."""

from collections.abc import Sequence
from pathlib import Path

from capture.arguments import Output
from capture.errors import InputError
from capture.output import refuse_existing, write_text
from capture.progress import progress
from lighting.maps.environment import EnvironmentMap
from lighting.maps.environment_files import read_environment
from lighting.measures import chart
from lighting.measures.known import write_known
from lighting.reduce import METHODS
from lighting.simulation.outdoors import outdoors
from lighting.simulation.sequences import SEQUENCES

KNOWN_NAME = "measurements.json"
_MADE_ROWS = 512


def chart_lights(
    *environments: Path, output: Output, fresh: bool = False, force: bool = False
) -> None:
    """Chart error against time of every way to find lights, with 4 to 1024 lights.

    Error is that of the irradiance on 192 surfaces, in the open and behind a wall's edge, a sphere
    and a comb, against the sum over all cells of the map. Flicker is what changes more than it
    should on made skies in which suns move, clouds pass and lamps are switched. Peers are measured
    beside fishlight's methods: random and Hammersley points, median cut in numpy, and Mitsuba 3 and
    colour-hdri where they are installed.

    Parameters
    ----------
    environments
        Lat-long maps, EXR or Radiance .hdr; the chart has medians over them. Without any, a made
        map of 1024×512 that looks like outdoors.
    output
        Folder for lights-light and lights-dark, each as .svg and .png, lights.csv with every
        number, and measurements.json, from which later runs take what they need.
    fresh
        Measure everything again.
    force
        Replace the charts of an earlier run.
    """
    # Here, so that no other command waits a second for matplotlib and scipy.
    from lighting.measures import flicker
    from lighting.measures.chart_drawing import draw

    maps = _read_maps(environments)
    if output.exists() and not output.is_dir():
        raise InputError(f"{output} is a file; give --output a folder")
    pictures = {
        output / f"lights-{theme}{suffix}": theme
        for theme in ("light", "dark")
        for suffix in (".svg", ".png")
    }
    table = output / "lights.csv"
    for path in (*pictures, table):
        refuse_existing(path, force=force)

    compared, missing = chart.systems()
    if missing:
        print(f"not installed, so not in the chart: {', '.join(missing)}")
    output.mkdir(parents=True, exist_ok=True)
    known_path = output / KNOWN_NAME
    known = {} if fresh else chart.read_known(known_path)
    on_maps = chart.measure(maps, compared, chart.COUNTS, known)
    on_sequences = flicker.measure(SEQUENCES, compared, flicker.COUNTS, known)
    jobs = len(maps) * len(compared) * len(chart.COUNTS)
    flicker_jobs = len(SEQUENCES) * len(compared) * len(flicker.COUNTS)
    try:
        errors = [row for row in progress(on_maps, "errors", jobs) if row]
        flickers = [row for row in progress(on_sequences, "flicker", flicker_jobs) if row]
    finally:  # an interrupted run is not measured again either
        write_known(known_path, known)

    write_text(table, chart.as_csv(errors + flickers))
    points = chart.points_of(errors, flickers)
    for path, theme in pictures.items():
        draw(points, [*METHODS, chart.STEADY], _about(maps), path, theme)
    print(
        f"{output}: {len(errors) + len(flickers)} measurements of {len(compared)} systems on "
        f"{len(maps)} {'map' if len(maps) == 1 else 'maps'} and {len(SEQUENCES)} sequences"
    )


def _read_maps(paths: Sequence[Path]) -> dict[str, EnvironmentMap]:
    """Return the maps by name, all read before anything is measured."""
    if not paths:
        return {"made, outdoors": outdoors(_MADE_ROWS)}
    maps = {}
    for path in paths:
        environment, cleaned = read_environment(path)
        if not environment.radiance.any():
            raise InputError(f"{path}: there is no light in it to compare lights by")
        for remark in cleaned.remarks:
            print(f"{path}: {remark}")
        maps[str(path)] = environment
    return maps


def _about(maps: dict[str, EnvironmentMap]) -> str:
    sizes = {f"{2 * environment.height}×{environment.height}" for environment in maps.values()}
    of = f"{len(maps)} maps (medians)" if len(maps) > 1 else next(iter(maps)).rsplit("/", 1)[-1]
    return f"4, 8, 16 … 1024 lights from {of}, {' and '.join(sorted(sizes))}."
