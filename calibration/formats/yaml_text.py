"""The part of YAML that calibration files are written in.

Domain : nested mappings and lists, indented or in brackets, and plain or quoted scalars, as Kalibr
and OpenCV write them. Tags (!!opencv-matrix) are passed over.
Output : dict, list, float, bool, str or None.
Fails  : anchors, aliases, several documents and text blocks are refused: no calibration has them,
and without them a small file cannot unfold into a large one.
"""

import re
from collections import deque
from typing import Any, NoReturn

from capture.errors import InputError

_DEEPEST = 12

_KEY = re.compile(r"""(?P<key>"[^"]*"|'[^']*'|[^\s\[\]{},#:"'][^\[\]{},#:]*?)\s*:(?:\s+|$)""")

_TOKEN = re.compile(r"""\s*(?P<token>[\[\]{},:]|"[^"]*"|'[^']*'|[^\s\[\]{},:"'][^\[\]{},:]*)""")

_TAG = re.compile(r"!\S*\s*")

_NUMBER = re.compile(r"[-+]?(\d++\.?\d*+|\.\d+)([eE][-+]?\d+)?")

_WORDS: dict[str, Any] = {
    "": None, "~": None, "null": None, "true": True, "false": False,
    ".nan": float("nan"), ".inf": float("inf"), "-.inf": float("-inf"),
}  # fmt: skip

_Line = tuple[int, str]
"""Indentation and text."""


def parse_yaml(text: str) -> Any:
    """Return what a YAML text holds.

    Raises
    ------
    InputError
        If it is not of the part of YAML that is read, or nested deeper than twelve levels.
    """
    lines = _lines(text)
    if not lines:
        raise InputError("the file holds nothing")
    value = _block(lines, 0)
    if lines:
        _refuse(lines[0][1])
    return value


def _refuse(text: str) -> NoReturn:
    raise InputError(f"wanted YAML of mappings, lists and numbers; cannot make out {text[:60]!r}")


def _lines(text: str) -> deque[_Line]:
    """Return the lines that say something; brackets that span several are joined."""
    lines: deque[_Line] = deque()
    joined: list[str] = []
    indent, open_brackets = 0, 0
    for raw in text.splitlines():
        line = re.sub(r"(^|\s)#.*$", "", raw).rstrip()
        stripped = " ".join(line.split())  # or patterns would look at the same spaces over and over
        if not stripped or stripped in ("---", "...") or line.startswith("%"):
            continue
        if not joined:
            indent = len(line) - len(line.lstrip(" "))
        joined.append(stripped)
        open_brackets += sum(map(stripped.count, "[{")) - sum(map(stripped.count, "]}"))
        if open_brackets <= 0:
            lines.append((indent, " ".join(joined)))
            joined, open_brackets = [], 0
    if joined:
        _refuse(joined[0])
    return lines


def _block(lines: deque[_Line], depth: int) -> Any:
    """Return the value that the lines begin with, and take it from them."""
    if depth > _DEEPEST:
        raise InputError(f"nested deeper than {_DEEPEST} levels: no calibration file is")
    indent, text = lines[0]
    if _is_item(text):
        return _list(lines, indent, depth)
    if _KEY.match(text):
        return _mapping(lines, indent, depth)
    lines.popleft()
    return _flow(text)


def _is_item(text: str) -> bool:
    return text == "-" or text.startswith("- ")


def _list(lines: deque[_Line], indent: int, depth: int) -> list[Any]:
    items = []
    while lines and lines[0][0] == indent and _is_item(lines[0][1]):
        text = lines.popleft()[1][1:]
        if text:
            lines.appendleft((indent + 1 + len(text) - len(text.lstrip()), text.strip()))
        within = bool(lines) and lines[0][0] > indent
        items.append(_block(lines, depth + 1) if within else None)
    return items


def _mapping(lines: deque[_Line], indent: int, depth: int) -> dict[str, Any]:
    values: dict[str, Any] = {}
    while lines and lines[0][0] == indent:
        match = _KEY.match(lines[0][1])
        if match is None:
            break
        text = lines.popleft()[1][match.end() :]
        text = _TAG.sub("", text, count=1) if text.startswith("!") else text
        key = match["key"].strip("\"'")
        if text:
            values[key] = _flow(text)
        elif lines and (lines[0][0] > indent or (lines[0][0] == indent and _is_item(lines[0][1]))):
            values[key] = _block(lines, depth + 1)
        else:
            values[key] = None
    return values


def _flow(text: str) -> Any:
    """Return the value of a scalar or of brackets on one line."""
    if text[0] not in "[{":
        return _scalar(text)
    tokens = deque(match["token"].strip() for match in _TOKEN.finditer(text))
    if re.sub(r"\s", "", "".join(tokens)) != re.sub(r"\s", "", text):
        _refuse(text)
    value = _bracketed(tokens, text, 0)
    if tokens:
        _refuse(text)
    return value


def _bracketed(tokens: deque[str], text: str, depth: int) -> Any:
    """Return the value that the tokens begin with, and take it from them."""
    if depth > _DEEPEST or not tokens or tokens[0] in ("]", "}", ",", ":"):
        _refuse(text)
    opening = tokens.popleft()
    if opening not in ("[", "{"):
        return _scalar(opening)
    closing = "]" if opening == "[" else "}"
    items: list[Any] = []
    while tokens and tokens[0] != closing:
        value = _bracketed(tokens, text, depth + 1)
        if opening == "{":
            if not tokens or tokens.popleft() != ":":
                _refuse(text)
            value = (str(value), _bracketed(tokens, text, depth + 1))
        items.append(value)
        if tokens and tokens[0] == ",":
            tokens.popleft()
        else:
            break
    if not tokens or tokens.popleft() != closing:
        _refuse(text)
    return items if opening == "[" else dict(items)


def _scalar(text: str) -> Any:
    if text[0] in "\"'":
        return text[1:-1]
    if text[0] in "&*|>!@`":
        raise InputError(f"{text[:40]!r}: this part of YAML is not read")
    if text.lower() in _WORDS:
        return _WORDS[text.lower()]
    if _NUMBER.fullmatch(text):
        return float(text)
    return text
