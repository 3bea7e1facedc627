"""A session's stream of lights, followed by another program.

Input  : the address that `fishlight live` printed.    Output : one StreamMessage after the other.
Fails  : what was sent while the follower was busy is not seen: the newest wins (stream.py).
"""

import asyncio
import os
from collections.abc import Callable
from urllib.parse import parse_qs, urlsplit

import aiohttp
import msgspec

from capture.errors import FishlightError, InputError
from render.live.stream import PROTOCOL, SCHEMA, StreamMessage

TOKEN_VARIABLE = "FISHLIGHT_TOKEN"
"""Of the environment, for addresses without a token: other users see command lines."""

_MOST_BYTES = 2**24
_SILENCE_S = 30.0


class StreamLost(FishlightError):
    """The stream ended before its session did."""


def follow(address: str, take: Callable[[str, StreamMessage], bool]) -> None:
    """Give each message, as text and as read, to `take` until it returns False or all has ended.

    Raises
    ------
    InputError
        If there is no session at the address, it refuses the token, or what it sends is not known.
    StreamLost
        If it stops sending.
    """
    url, token = parse_address(address)
    asyncio.run(_follow(url, token, take))


def parse_address(address: str) -> tuple[str, str]:
    """Return the stream's URL and the token of an address as `fishlight live` prints it.

    Raises
    ------
    InputError
        If it is no such address, or there is no token in it nor in FISHLIGHT_TOKEN.
    """
    try:
        parts = urlsplit(address if "//" in address else f"http://{address}")
        is_address = parts.scheme == "http" and bool(parts.hostname) and parts.port != 0
    except ValueError:  # brackets that do not close, a port that is no number
        is_address = False
    if not is_address:
        raise InputError(f"{address}: wanted the address that `fishlight live` printed")
    token = parse_qs(parts.query).get("token", [os.environ.get(TOKEN_VARIABLE, "")])[0]
    if not token:
        raise InputError(
            f"{address}: wanted the whole address that `fishlight live` printed, with its token "
            f"(or the token in {TOKEN_VARIABLE})"
        )
    return f"http://{parts.netloc}/lights", token


async def _follow(url: str, token: str, take: Callable[[str, StreamMessage], bool]) -> None:
    headers = {"Authorization": f"Bearer {token}"}
    async with aiohttp.ClientSession(headers=headers) as session:
        try:
            async with session.ws_connect(
                url, protocols=(PROTOCOL,), max_msg_size=_MOST_BYTES
            ) as socket:
                while True:
                    message = await asyncio.wait_for(socket.receive(), _SILENCE_S)
                    if message.type is not aiohttp.WSMsgType.TEXT:
                        raise StreamLost(f"{url}: the stream has ended")
                    read = _read(url, message.data)
                    if not take(message.data, read) or read.state == "ended":
                        return
        except aiohttp.WSServerHandshakeError as error:
            reason = "the token is wrong or old" if error.status == 401 else error.message
            raise InputError(f"{url}: refused ({error.status}): {reason}") from None
        except aiohttp.ClientError as error:
            raise InputError(f"{url}: no session is there ({error})") from None
        except TimeoutError:
            raise StreamLost(f"{url}: nothing came for {_SILENCE_S:.0f} s") from None


def _read(url: str, text: str) -> StreamMessage:
    try:
        message = msgspec.json.decode(text, type=StreamMessage)
    except (msgspec.MsgspecError, RecursionError) as error:
        raise InputError(f"{url}: sends no lights ({error})") from None
    if message.schema.split(".")[0] != SCHEMA:
        raise InputError(f"{url}: sends {message.schema}, wanted {SCHEMA}; update fishlight")
    return message
