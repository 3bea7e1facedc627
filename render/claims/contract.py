"""What a claim is, and what was found of it."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from statistics import median

import msgspec

from lighting.maps.environment import EnvironmentMap

CONFIRMED, NOT_CONFIRMED, PARTLY = "confirmed", "not confirmed", "confirmed in part"
UNDECIDED = "undecided"


class Finding(msgspec.Struct, frozen=True):
    """What was measured in one setting: a map, a surface, a number of lights.

    `figures` are plain numbers by what they are, with their unit. `holds` is None where the claim
    says nothing of such a setting, or where the figures differ by no more than chance makes them.
    """

    setting: str
    figures: dict[str, float]
    holds: bool | None


Maps = Mapping[str, EnvironmentMap]


@dataclass(frozen=True)
class Claim:
    """What somebody says, and how it is measured here.

    Attributes
    ----------
    name, says, source : str
        In a few words; in a sentence; who, where and when.
    test : str
        What is measured, and when it is said to hold.
    measure : callable
        From maps by name to findings.
    decided_by : str
        The figure of findings that tells whether it holds.
    """

    name: str
    says: str
    source: str
    test: str
    measure: Callable[[Maps], list[Finding]]
    decided_by: str


def over(error: float, other: float) -> float:
    """Return error / other; infinite where only the other is 0, and 1 where both are."""
    if other == 0:
        return 1.0 if error == 0 else math.inf
    return error / other


def found(claim: Claim, findings: Sequence[Finding]) -> str:
    """Return the range and the median of what decides a claim."""
    told = [each.figures for each in findings]
    values = [figures[claim.decided_by] for figures in told if claim.decided_by in figures]
    least, middle, most = min(values), median(values), max(values)
    return f"{claim.decided_by} {least:.3g} to {most:.3g}, median {middle:.3g}"


def verdict(findings: Sequence[Finding]) -> str:
    """Return whether a claim is confirmed, by all settings that decide it, some or none."""
    held = [finding.holds for finding in findings if finding.holds is not None]
    if not held:
        return UNDECIDED
    if all(held):
        return CONFIRMED
    return f"{PARTLY}, {sum(held)} of {len(held)} settings" if any(held) else NOT_CONFIRMED
