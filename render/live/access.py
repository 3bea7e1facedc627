"""Who may talk to the server: requests judged by host, origin and token.

A page of another site, whose scripts run in the same browser, must reach nothing: its Origin is not
ours, and after DNS rebinding its Host is not. Another user of the machine has no token: a browser
is started with a ticket, which he may see and which is spent by then.
"""

import hmac
import ipaddress
import secrets
import socket
import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from urllib.parse import urlsplit

from capture.errors import InputError

LOOPBACK = "127.0.0.1"
PROTOCOL_PREFIX = "fishlight.token."
"""A page of another origin cannot set headers of a WebSocket; it offers the token as a protocol."""

TICKET_LASTS_S = 60.0
"""Time for a browser to start in."""

_LOOPBACK_NAMES = ("127.0.0.1", "localhost", "::1")
_WILDCARDS = ("0.0.0.0", "::")


def _new_token() -> str:
    return secrets.token_urlsafe(32)


def _is_secret(offered: str | None, secret: str) -> bool:
    as_sent = (offered or "").encode(errors="surrogateescape")  # headers are any bytes
    return hmac.compare_digest(as_sent, secret.encode())


@dataclass(frozen=True)
class Access:
    """The rules of one server.

    Attributes
    ----------
    host : str
        Address that it listens on.
    origins : tuple of str
        Pages beside its own that may follow the lights, such as http://localhost:5173.
    token : str
        Random for each run.
    """

    host: str = LOOPBACK
    origins: tuple[str, ...] = ()
    token: str = field(default_factory=_new_token, repr=False)

    @property
    def name(self) -> str:
        """What the server is called in its address."""
        return socket.gethostname() if self.host in _WILDCARDS else self.host

    def is_own_host(self, host_header: str | None) -> bool:
        """Whether a Host header names this server and not another site's alias of it."""
        name = _host_name(host_header)
        if name is None:
            return False
        if name in _LOOPBACK_NAMES or name == self.host.lower():
            return True
        if self.host not in _WILDCARDS:
            return False
        return _is_address(name) or name == socket.gethostname().lower()

    def is_allowed_origin(self, origin: str | None, host_header: str | None) -> bool:
        """Whether an Origin header is absent, this server's own, or one that was let in."""
        return origin is None or origin == f"http://{host_header}" or origin in self.origins

    def is_token(self, offered: str | None) -> bool:
        """Whether the token is right, in a time that does not tell how much of it is."""
        return _is_secret(offered, self.token)


class Ticket:
    """Lets one in once, and soon: for a command's arguments, which all users of a machine see.

    Attributes
    ----------
    text : str
        What is to be offered.
    """

    def __init__(self) -> None:
        self.text = _new_token()
        self._good_until_s = time.monotonic() + TICKET_LASTS_S

    def spend(self, offered: str) -> bool:
        """Whether it is this ticket, and still good; it is not after that."""
        if not _is_secret(offered, self.text) or time.monotonic() > self._good_until_s:
            return False
        self._good_until_s = float("-inf")
        return True


def offered_token(authorization: str | None, protocols: str | None) -> str | None:
    """Return the token in an Authorization or Sec-WebSocket-Protocol header."""
    scheme, _, token = (authorization or "").partition(" ")
    if scheme.lower() == "bearer":
        return token.strip()
    for protocol in (protocols or "").split(","):
        if protocol.strip().startswith(PROTOCOL_PREFIX):
            return protocol.strip().removeprefix(PROTOCOL_PREFIX)
    return None


def checked_origins(origins: Sequence[str]) -> tuple[str, ...]:
    """Return origins as browsers write them; InputError for anything that is none."""
    for origin in origins:
        scheme, _, host = origin.partition("://")
        if scheme not in ("http", "https") or _host_name(host) is None or set(host) & set("/?#@"):
            raise InputError(
                f"--origin {origin}: wanted scheme, host and port, http://localhost:5173"
            )
    return tuple(origins)


def _host_name(host_header: str | None) -> str | None:
    try:
        return urlsplit(f"//{host_header}").hostname if host_header else None
    except ValueError:
        return None


def _is_address(name: str) -> bool:
    try:
        ipaddress.ip_address(name)
    except ValueError:
        return False
    return True
