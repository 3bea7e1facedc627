"""The server of a live session: its page, its pictures and the stream of its lights.

It runs in a thread of its own and never makes the session wait. Each client is sent the newest
there is when it is ready for it: one that sleeps is sent nothing, and one that takes nothing is let
go after some seconds.

A defect while a moment is made into messages ends the session: viewers would wait for nothing.

Input  : what the Desk publishes; requests, judged by `Access` before anything else is looked at.
Output : GET / and its parts; the WebSockets /view (pictures, settings) and /lights (stream.py).
No request names a file: the page's parts are a fixed list, and results are named by the session.
"""

import asyncio
import threading
from collections.abc import Awaitable, Callable
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from types import TracebackType
from typing import Self

from aiohttp import web

from capture.errors import InputError
from render.live.access import Access, Ticket, offered_token
from render.live.channel import Channel
from render.live.conversing import VIOLATION, obey, send_newest
from render.live.desk import Desk
from render.live.encoding import encode_frame
from render.live.limits import HEARTBEAT_S, MOST_CLIENTS, MOST_MESSAGE_BYTES
from render.live.page import HEADERS, refusal, serve_page
from render.live.stream import PROTOCOL, stream_message

_TOO_MANY = 1013  # WebSocket close code, IANA's registry
_LAST_WORDS_S = 0.2  # for clients to take them, before their connections are closed
_IN_FLIGHT = 2  # pictures sent that were not yet said to be shown


class LiveServer:
    """Serves a desk while its `with` block lasts.

    Parameters
    ----------
    desk : Desk
    access : Access
    port : int
        0 for any that is free.
    on_defect : callable
        Told, from whatever thread, when nothing can be shown any more because of a defect, which
        is raised at the end of the block.

    Attributes
    ----------
    address : str
        To be opened in a browser, with the token.

    Raises
    ------
    InputError
        If the address cannot be listened on.
    """

    def __init__(
        self,
        desk: Desk,
        access: Access,
        port: int = 0,
        on_defect: Callable[[], None] = lambda: None,
    ) -> None:
        self._desk = desk
        self._access = access
        self._port = port
        self._on_defect = on_defect
        self._defect: Exception | None = None
        self._ticket = Ticket()
        self._thread = threading.Thread(target=self._run, name="fishlight-server", daemon=True)
        self._ready = threading.Event()
        self._error: str | None = None
        self._loop: asyncio.AbstractEventLoop
        self._stopped: asyncio.Event
        self._news: asyncio.Event
        self._view: Channel[bytes]
        self._lights: Channel[str]
        self._viewers: set[web.WebSocketResponse] = set()
        self._followers: set[web.WebSocketResponse] = set()

    def __enter__(self) -> Self:
        self._thread.start()
        self._ready.wait()
        if self._error is not None:
            raise InputError(f"--host {self._access.host} --port {self._port}: {self._error}")
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self._loop.call_soon_threadsafe(self._stopped.set)
        self._thread.join()
        if self._defect is not None and error is None:
            raise self._defect

    @property
    def address(self) -> str:
        """Where to go, the token included."""
        return f"{self._base}?token={self._access.token}"

    def address_for_once(self) -> str:
        """Return where a browser that is started now can go, once: with a new ticket, no token."""
        self._ticket = Ticket()
        return f"{self._base}?ticket={self._ticket.text}"

    @property
    def _base(self) -> str:
        host = self._access.name
        host = f"[{host}]" if ":" in host else host
        return f"http://{host}:{self._port}/"

    def _run(self) -> None:
        asyncio.run(self._serve())

    async def _serve(self) -> None:
        self._loop = asyncio.get_running_loop()
        self._stopped, self._news = asyncio.Event(), asyncio.Event()
        self._view, self._lights = Channel(), Channel()
        app = web.Application(middlewares=[self._judged], client_max_size=MOST_MESSAGE_BYTES)
        app.router.add_get("/view", self._serve_view)
        app.router.add_get("/lights", self._serve_lights)
        app.router.add_get("/{name:[a-z]*[.a-z]*}", serve_page)
        runner = web.AppRunner(app, access_log=None, shutdown_timeout=1.0)
        await runner.setup()
        site = web.TCPSite(runner, self._access.host, self._port)
        try:
            await site.start()
        except (OSError, UnicodeError) as error:  # the second from names that are none
            self._error = getattr(error, "strerror", None) or str(error)
            self._ready.set()
            await runner.cleanup()
            return
        self._port = runner.addresses[0][1]
        self._desk.listen(self._on_news)
        with ThreadPoolExecutor(1, "fishlight-encoder") as encoder:
            encoding = asyncio.create_task(self._encode(encoder))
            self._ready.set()
            await self._stopped.wait()
            encoding.cancel()
            with suppress(asyncio.CancelledError):
                await encoding
            await self._encode_newest(encoder)  # how the session ended
            await asyncio.sleep(_LAST_WORDS_S)
        for client in {*self._viewers, *self._followers}:
            with suppress(Exception):
                await asyncio.wait_for(client.close(), 0.5)
        await runner.cleanup()

    def _on_news(self) -> None:
        with suppress(RuntimeError):  # the loop has ended
            self._loop.call_soon_threadsafe(self._news.set)

    async def _encode(self, encoder: ThreadPoolExecutor) -> None:
        while True:
            await self._news.wait()
            self._news.clear()
            await self._encode_newest(encoder)

    async def _encode_newest(self, encoder: ThreadPoolExecutor) -> None:
        """Make messages of what was published last, of pictures only if somebody wants them."""
        frame = self._desk.newest
        if frame is None or self._defect is not None:
            return
        try:
            await self._lights.put(stream_message(frame))
            if self._viewers:
                data = await self._loop.run_in_executor(encoder, encode_frame, frame, self._desk)
                await self._view.put(data)
        except Exception as defect:
            self._defect = defect
            self._on_defect()

    @web.middleware
    async def _judged(
        self,
        request: web.Request,
        handler: Callable[[web.Request], Awaitable[web.StreamResponse]],
    ) -> web.StreamResponse:
        """Refuse what does not come from a page of ours, or from one who has the token."""
        host, origin = request.headers.get("Host"), request.headers.get("Origin")
        access = self._access
        if not access.is_own_host(host) or not access.is_allowed_origin(origin, host):
            return refusal(403, "This host or origin is not served.")
        ticket = request.query.get("ticket")
        if ticket is not None and self._ticket.spend(ticket):
            return self._let_in()
        offered = (
            request.query.get("token")
            or offered_token(
                request.headers.get("Authorization"), request.headers.get("Sec-WebSocket-Protocol")
            )
            or request.cookies.get(self._cookie)
        )
        if not access.is_token(offered):
            return refusal(
                401, "This needs the whole address that `fishlight live` printed, with its token."
            )
        if "token" in request.query:
            return self._let_in()
        try:
            response = await handler(request)
        except web.HTTPException as error:
            return refusal(error.status, error.reason)
        if not response.prepared:
            response.headers.update(HEADERS)
        return response

    @property
    def _cookie(self) -> str:
        return f"fishlight-{self._port}"  # cookies of all ports of a host are sent to each

    def _let_in(self) -> web.StreamResponse:
        """Give the token as a cookie, and take what was offered out of the address."""
        response = web.Response(status=303, headers={**HEADERS, "Location": "/"})
        response.set_cookie(self._cookie, self._access.token, httponly=True, samesite="Strict")
        return response

    async def _serve_view(self, request: web.Request) -> web.StreamResponse:
        if request.headers.get("Origin") in self._access.origins:
            raise web.HTTPForbidden  # other pages follow the lights and steer nothing
        socket = await self._opened(request, self._viewers)
        if not socket.closed:
            self._desk.begin_watching()
            self._news.set()
            shown = asyncio.BoundedSemaphore(_IN_FLIGHT)
            sending = asyncio.create_task(send_newest(socket, self._view, shown))
            try:
                await obey(socket, self._desk, shown)
            finally:
                sending.cancel()
                self._desk.end_watching()
        self._left(socket)
        return socket

    async def _serve_lights(self, request: web.Request) -> web.StreamResponse:
        socket = await self._opened(request, self._followers)
        if not socket.closed:
            sending = asyncio.create_task(send_newest(socket, self._lights))
            try:
                async for _ in socket:  # followers have nothing to say
                    await socket.close(code=VIOLATION)
            finally:
                sending.cancel()
        self._left(socket)
        return socket

    async def _opened(
        self, request: web.Request, clients: set[web.WebSocketResponse]
    ) -> web.WebSocketResponse:
        """Return the WebSocket, closed if there are too many."""
        socket = web.WebSocketResponse(
            max_msg_size=MOST_MESSAGE_BYTES,
            heartbeat=HEARTBEAT_S,
            protocols=(PROTOCOL,),
            compress=False,
        )
        socket.headers.update(HEADERS)
        await socket.prepare(request)
        if len(clients) >= MOST_CLIENTS:
            await socket.close(code=_TOO_MANY, message=b"too many clients")
        else:
            clients.add(socket)
        return socket

    def _left(self, socket: web.WebSocketResponse) -> None:
        self._viewers.discard(socket)
        self._followers.discard(socket)
