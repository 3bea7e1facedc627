"""`fishlight doctor`: what this machine has for fishlight."""

from capture.errors import FishlightError
from render.doctor import examine


def doctor() -> None:
    """Show what this machine has for fishlight, what is missing, and how to mend it."""
    findings = examine()
    width = max(len(finding.subject) for finding in findings)
    for finding in findings:
        mark = "ok" if finding.is_good else "MISSING" if finding.is_required else "note"
        print(f"{finding.subject:<{width}}  {mark:<7}  {finding.found}")
        if not finding.is_good:
            print(f"{'':<{width}}  {'':<7}  {finding.remedy}")
    missing = [
        finding.subject for finding in findings if finding.is_required and not finding.is_good
    ]
    if missing:
        raise FishlightError(f"not ready: {', '.join(missing)} (see above)")
