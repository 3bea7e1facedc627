"""All claims, and what was found of each; earlier findings are not measured again."""

import csv
import io
import textwrap
from collections.abc import Iterator, Mapping, Sequence

import msgspec

from lighting.maps.environment import EnvironmentMap
from render.claims.combined_techniques import BESIDE, GLOSSY
from render.claims.contract import Claim, Finding, found, verdict
from render.claims.estimated import RESAMPLING, WAVELET
from render.claims.light_counts import KOLLIG_KELLER, STRUCTURED
from render.claims.occlusion import OCCLUSION
from render.claims.point_light import POINT_LIGHT

CLAIMS: tuple[Claim, ...] = (
    WAVELET,
    STRUCTURED,
    KOLLIG_KELLER,
    GLOSSY,
    BESIDE,
    RESAMPLING,
    OCCLUSION,
    POINT_LIGHT,
)

Checked = tuple[Claim, Sequence[Finding]]


class Findings(msgspec.Struct, frozen=True):
    """All that was found of one claim."""

    findings: list[Finding]


def check(
    claims: Sequence[Claim],
    maps: Mapping[str, EnvironmentMap],
    digest: str,
    known: dict[str, Findings],
) -> Iterator[Checked]:
    """Yield each claim with what was found of it, from `known` or measured and added to it.

    `digest` tells maps, and versions of the code, apart.
    """
    for claim in claims:
        key = f"{digest} {claim.name}"
        if key not in known:
            known[key] = Findings(claim.measure(maps))
        yield claim, known[key].findings


def as_csv(checked: Sequence[Checked]) -> str:
    """Return a line for each figure."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(["claim", "source", "verdict", "setting", "holds", "figure", "value"])
    for claim, findings in checked:
        told = verdict(findings)
        for finding in findings:
            holds = "" if finding.holds is None else str(finding.holds).lower()
            for figure, value in finding.figures.items():
                row = (claim.name, claim.source, told, finding.setting, holds, figure)
                writer.writerow([*row, f"{value:.5g}"])
    return text.getvalue()


def as_text(checked: Sequence[Checked]) -> str:
    """Return what is claimed and what was found, for people: a paragraph and a table for each."""
    return "\n".join(_told(claim, findings) for claim, findings in checked)


def _told(claim: Claim, findings: Sequence[Finding]) -> str:
    paragraphs = (
        f"{claim.name}: {verdict(findings).upper()}",
        f"Claim: {claim.says} ({claim.source})",
        f"Test: {claim.test}",
        f"Found: {found(claim, findings)}",
    )
    lines = [line for paragraph in paragraphs for line in textwrap.wrap(paragraph, 100)]
    for finding in findings:
        figures = ", ".join(f"{name} {value:.3g}" for name, value in finding.figures.items())
        mark = {True: "yes", False: "NO", None: ""}[finding.holds]
        lines.append(f"  {mark:3} {finding.setting}: {figures}")
    return "\n".join(lines) + "\n"
