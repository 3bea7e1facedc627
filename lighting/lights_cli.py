"""`fishlight lights`: from an environment map to lights.json."""

from pathlib import Path

from capture.arguments import Output, WholeNumber
from lighting.environment_files import read_environment
from lighting.light_files import write_lights
from lighting.reduce import reduce_to_lights


def lights(
    environment: Path,
    *,
    output: Output,
    count: WholeNumber = 64,
    method: str = "inverse-cdf",
    force: bool = False,
) -> None:
    """Reduce an environment map to distant lights.

    Parameters
    ----------
    environment
        Lat-long map, EXR or Radiance .hdr.
    output
        The lights, as JSON.
    count
        Number of lights, at least 1.
    method
        How the lights are found: inverse-cdf, median-cut, variance-minimisation or cells.
    force
        Replace the output if it exists.
    """
    environment_map, cleaned = read_environment(environment)
    light_set = reduce_to_lights(environment_map, count, method, source=environment.name)
    write_lights(output, light_set, force=force)

    red, green, blue = light_set.irradiance.sum(axis=0)
    print(
        f"{output}: {light_set.source}; total irradiance "
        f"{red:.4g} {green:.4g} {blue:.4g} ({light_set.scale} × sr)"
    )
    if str(cleaned):
        print(f"  set to 0 in the map: {cleaned} values")
    if light_set.clipped_fraction > 0:
        print(
            f"  {light_set.clipped_fraction:.1%} of the light comes from clipped cells: "
            "the lights are a lower bound"
        )
