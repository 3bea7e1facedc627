"""Text of unknown origin on its way to a terminal or a manifest."""


def printable(text: str) -> str:
    """Return text without what could steer a terminal: a mark stands for each such letter."""
    return "".join(
        letter if letter.isprintable() else "\N{REPLACEMENT CHARACTER}" for letter in text
    )
