"""Speed and accuracy of every stage against its peers: `make bench`.

Not a timed test: a program that writes results.json, results.md, lights.svg and lights-dark.svg
beside itself. Each stage's module has a `run(repeats)` that times ours and the peer in this process
and returns rows {stage, case, system, ms, ratio, accuracy}; ms is the median over the repeats, of
lights the least (lighting/measures/chart.py), ratio is the peer's time over ours. Absolute times
belong to the machine named in the file.
"""

import argparse
import datetime
import json
import os
import platform
from importlib import import_module
from importlib.metadata import version
from pathlib import Path
from typing import Any

from capture.kernel_cache import drop_stale_kernels
from tests.benchmarks.chart import draw_rows

HERE = Path(__file__).parent
STAGES = (
    "pipeline",
    "merge",
    "camera",
    "remap",
    "source",
    "lights",
    "light_figures",
    "ball",
    "photometry",
    "render",
    "rigid",
    "opengl",
    "loop",
    "viewers",
    "batch",
    "reference",
    "rays",
)


def machine() -> dict[str, Any]:
    """Return what the figures depend on: processor, cores, versions."""
    model = platform.processor()
    cpuinfo = Path("/proc/cpuinfo")
    if cpuinfo.exists():
        names = [line for line in cpuinfo.read_text().splitlines() if line.startswith("model name")]
        model = names[0].split(":", 1)[1].strip() if names else model
    return {
        "processor": model,
        "cores": len(os.sched_getaffinity(0)),
        "system": platform.platform(terse=True),
        "python": platform.python_version(),
        "versions": {
            name: version(name)
            for name in ("numpy", "numba", "opencv-contrib-python-headless", "moderngl")
        },
    }


def as_table(rows: list[dict[str, Any]]) -> str:
    """Markdown table of the rows of one stage."""
    keys = list(dict.fromkeys(key for row in rows for key in row.get("accuracy", {})))
    header = ["case", "system", "ms", "peer ÷ ours", *keys]
    lines = ["| " + " | ".join(header) + " |", "|" + " --- |" * len(header)]
    for row in rows:
        accuracy = row.get("accuracy", {})
        cells = [row["case"], row["system"], _number(row["ms"]), _number(row.get("ratio"))]
        cells += [_number(accuracy.get(key)) for key in keys]
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines)


def _number(value: object) -> str:
    if value is None:
        return ""
    return f"{value:.3g}" if isinstance(value, float | int) else str(value)


def main() -> None:
    """Run the benchmarks of the stages asked for and write their results."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--repeats", type=int, default=15)
    parser.add_argument("--stages", nargs="*", choices=STAGES, default=STAGES)
    parser.add_argument("--output", type=Path, default=HERE)
    arguments = parser.parse_args()
    arguments.output.mkdir(parents=True, exist_ok=True)
    os.environ.setdefault("OMP_WAIT_POLICY", "passive")  # as render/main.py does
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

    drop_stale_kernels()

    results: dict[str, Any] = {
        "date": datetime.date.today().isoformat(),
        "command": "make bench",
        "machine": machine(),
        "rows": [],
    }
    tables = []
    for stage in arguments.stages:
        rows = import_module(f"tests.benchmarks.{stage}").run(arguments.repeats)
        results["rows"] += rows
        tables.append(f"## {stage}\n\n{as_table(rows)}\n")
        print(tables[-1], flush=True)
    about = results["machine"]
    heading = (
        f"# Benchmark\n\nMade by `make bench` on {results['date']}: {about['processor']}, "
        f"{about['cores']} cores, Python {about['python']}.\n\n"
    )
    (arguments.output / "results.json").write_text(json.dumps(results, indent=1) + "\n")
    (arguments.output / "results.md").write_text(heading + "\n".join(tables))
    if "lights" in arguments.stages:
        rows = [row for row in results["rows"] if row["stage"] == "lights"]
        draw_rows(rows, arguments.output)


if __name__ == "__main__":
    main()
