"""A live server on a socket of its own, and one who sends it requests as they stand."""

import asyncio
import http.client
from contextlib import contextmanager

import aiohttp

from render.live.access import Access
from render.live.desk import Desk
from render.live.models import load_models
from render.live.server import LiveServer
from render.live.settings import Settings

MODELS = load_models(())


@contextmanager
def served(**access):
    """Yield a desk and a site that serves it."""
    desk = Desk(Settings(), MODELS)
    with LiveServer(desk, Access(**access)) as server:
        yield desk, Site(server)


class Site:
    """A server as its clients see it."""

    def __init__(self, server):
        self.server = server
        base, self.token = server.address.split("/?token=")
        self.host = base.removeprefix("http://")
        self.port = int(self.host.rpartition(":")[2])

    def get(self, path="/", **headers):
        """Return status, headers and body of a request that is sent as it stands."""
        connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=5)
        named = {name.replace("_", "-"): value for name, value in headers.items()}
        connection.request("GET", path, headers=named)
        response = connection.getresponse()
        body = response.read()
        connection.close()
        return response.status, dict(response.headers), body

    @property
    def bearer(self):
        return {"Authorization": f"Bearer {self.token}"}

    def talk(self, act, path="view", **headers):
        """Return what `act` makes of a WebSocket, or the status that refused it."""

        async def run():
            async with aiohttp.ClientSession() as session:
                url = f"http://{self.host}/{path}"
                try:
                    async with session.ws_connect(url, headers=headers, max_msg_size=0) as ws:
                        return await asyncio.wait_for(act(ws), 10)
                except aiohttp.WSServerHandshakeError as error:
                    return error.status

        return asyncio.run(run())
