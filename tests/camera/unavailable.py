"""Why a guest cannot be had on this machine."""


class GuestUnavailable(Exception):
    """The guest cannot be started here; the message says what is missing and what installs it."""
