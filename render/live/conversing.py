"""One client of the server: what it is sent, when it is ready for it, and what it may say.

Input  : its WebSocket.    Output : messages, the newest each time; changes of the desk.
"""

import asyncio
from contextlib import suppress
from typing import Any

import msgspec
from aiohttp import WSMsgType, web

from capture.errors import FishlightError
from render.live.channel import Channel
from render.live.desk import Desk, Request
from render.live.limits import SEND_TIMEOUT_S, Allowance

VIOLATION = 1008
"""WebSocket close code, RFC 6455."""


class _Message(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """What a viewer may say."""

    set: dict[str, Any] | None = None
    ask: Request | None = None
    shown: int | None = None


async def send_newest(
    socket: web.WebSocketResponse, channel: Channel[Any], shown: asyncio.Semaphore | None = None
) -> None:
    """Send whatever is newest until the client leaves or takes none of it.

    Parameters
    ----------
    socket : WebSocketResponse
    channel : Channel of bytes or str
    shown : Semaphore or None
        Acquired for each message: a client that does not release it is sent nothing.
    """
    number = 0
    with suppress(ConnectionError, asyncio.CancelledError):
        while not socket.closed:
            if shown is not None:
                await shown.acquire()
            number, message = await channel.after(number)
            send = socket.send_bytes if isinstance(message, bytes) else socket.send_str
            try:
                await asyncio.wait_for(send(message), SEND_TIMEOUT_S)
            except TimeoutError:
                await socket.close(code=VIOLATION, message=b"too slow")


async def obey(socket: web.WebSocketResponse, desk: Desk, shown: asyncio.Semaphore) -> None:
    """Do what a viewer says until it leaves or says too much."""
    allowance = Allowance()
    async for message in socket:
        if message.type is not WSMsgType.TEXT or not allowance.take():
            await socket.close(code=VIOLATION, message=b"too much, or not understood")
            return
        try:
            said = msgspec.json.decode(message.data, type=_Message)
        except (msgspec.DecodeError, UnicodeError, RecursionError):
            await socket.close(code=VIOLATION, message=b"not understood")
            return
        if said.shown is not None:
            with suppress(ValueError):  # more was shown than sent, it says
                shown.release()
        try:
            if said.set is not None:
                desk.change(said.set)
            if said.ask is not None:
                desk.ask(said.ask)
        except FishlightError as error:
            desk.answer(str(error), is_error=True)
