"""Commands called as a shell calls them, by the application's own rules for their flags."""

from typing import Any

from render.app import app


def run(*tokens: Any) -> None:
    app([str(token) for token in tokens], exit_on_error=False, result_action="return_value")
