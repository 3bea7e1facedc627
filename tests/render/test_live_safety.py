"""Who may talk to a live session, how much, and what it never does whatever it is told.

Each test tries what it says cannot be done, against a server on a socket of its own.
"""

import asyncio
import json
import logging
import socket
import threading
import time
from contextlib import suppress

import aiohttp
import numpy as np
import pytest

from capture.errors import InputError
from lighting.light_set import LightSet
from render.live.access import Access, checked_origins
from render.live.desk import Desk, Seen, State
from render.live.limits import MOST_CLIENTS, MOST_MESSAGE_BYTES, Allowance
from render.live.server import LiveServer
from render.live.settings import Settings
from tests.render.live_site import MODELS, Site, served

FRIEND = "http://localhost:5173"


def moment(number=1, size_px=(64, 48)):
    lights = LightSet(np.array([[0.0, 1.0, 0.0]]), np.ones((1, 3)), np.zeros(1))
    noise = np.random.default_rng(number).random((size_px[1], size_px[0], 4), dtype=np.float32)
    return Seen(lights, None, None, noise, 0.0, False)


async def close_code(ws):
    while True:
        message = await ws.receive()
        if message.type in (aiohttp.WSMsgType.CLOSE, aiohttp.WSMsgType.CLOSED):
            return ws.close_code


async def nothing(_ws):
    return "open"


def test_it_listens_on_loopback_only():
    with served() as (_, site):
        with socket.create_connection(("127.0.0.1", site.port), timeout=2):
            pass
        others = {info[4][0] for info in socket.getaddrinfo(socket.gethostname(), None)}
        for other in others - {"127.0.0.1", "::1"}:
            with pytest.raises(OSError, match=r"refused|unreachable|assign"):
                socket.create_connection((other, site.port), timeout=2)


@pytest.mark.parametrize("path", ["/", "/app.js", "/lights", "/view", "/?token=wrong", "/nothing"])
def test_without_the_token_there_is_nothing(path):
    with served() as (_, site):
        assert site.get(path)[0] == 401
        assert site.get(path, Authorization="Bearer wrong")[0] == 401
        assert site.get(path, Cookie=f"fishlight-{site.port}=wrong")[0] == 401
        assert site.get(path, Authorization="Bearer \u00e9")[0] in (400, 401)


def test_another_port_s_cookie_is_not_ours():
    with served() as (_, site):
        assert site.get(Cookie=f"fishlight-{site.port + 1}={site.token}")[0] == 401


@pytest.mark.parametrize("host", ["evil.test", "evil.test:80", "127.0.0.1.evil.test", ""])
def test_a_name_of_another_site_that_leads_here_is_refused(host):
    with served() as (_, site):
        assert site.get(Host=host, **site.bearer)[0] in (400, 403)
        assert site.get(Host=f"localhost:{site.port}", **site.bearer)[0] == 200


def test_on_all_addresses_a_name_is_still_refused_but_an_address_is_not():
    access = Access("0.0.0.0")
    assert access.is_own_host("192.168.1.7:8040")
    assert access.is_own_host("[fe80::1]:8040")
    assert access.is_own_host(f"{access.name}:8040")
    assert not access.is_own_host("evil.test:8040")
    assert not access.is_own_host(None)
    assert not Access("192.168.1.7").is_own_host("192.168.1.8:8040")


@pytest.mark.parametrize("path", ["view", "lights"])
def test_a_page_of_another_origin_cannot_connect(path):
    with served() as (_, site):
        for origin in ("http://evil.test", f"http://localhost:{site.port}", "null"):
            assert site.talk(nothing, path, Origin=origin, **site.bearer) == 403
        assert site.talk(nothing, path, Origin=f"http://{site.host}", **site.bearer) == "open"
        assert site.talk(nothing, path, Origin=f"http://{site.host}") == 401
        assert site.talk(nothing, path, **site.bearer) == "open", "a program has no origin"


def test_a_page_that_was_let_in_follows_the_lights_and_steers_nothing():
    with served(origins=(FRIEND,)) as (_, site):
        protocol = {"Sec-WebSocket-Protocol": f"fishlight-lights.1, fishlight.token.{site.token}"}
        assert site.talk(nothing, "lights", Origin=FRIEND, **protocol) == "open"
        assert site.talk(nothing, "lights", Origin=FRIEND) == 401
        assert site.talk(nothing, "view", Origin=FRIEND, **protocol) == 403


@pytest.mark.parametrize(
    "origin", ["*", "localhost:5173", "http://a/b", "file:///x", "null", "http://", "http://["]
)
def test_an_origin_is_named_as_browsers_name_it(origin):
    with pytest.raises(InputError, match="--origin"):
        checked_origins([origin])
    assert checked_origins([FRIEND]) == (FRIEND,)


def test_the_token_leaves_the_address_and_stays_in_a_cookie():
    with served() as (_, site):
        status, headers, body = site.get(f"/?token={site.token}")
        assert (status, headers["Location"]) == (303, "/")
        cookie = headers["Set-Cookie"]
        assert cookie.startswith(f"fishlight-{site.port}="), "two sessions keep theirs apart"
        assert "HttpOnly" in cookie
        assert "SameSite=Strict" in cookie
        assert site.token.encode() not in body
        status, _, page = site.get(Cookie=cookie.partition(";")[0])
        assert status == 200
        assert site.token.encode() not in page


def test_the_token_is_not_logged_nor_shown(caplog, capfd):
    with caplog.at_level(logging.DEBUG), served() as (_, site):
        site.get(f"/?token={site.token}")
        site.get(f"/nothing?token={site.token}")
        site.get(**site.bearer)
        written = "".join(capfd.readouterr())
    assert site.token not in caplog.text
    assert site.token not in written
    assert site.token not in repr(Access(token=site.token))


def test_tokens_are_long_and_compared_whole():
    one, other = Access(), Access()
    assert one.token != other.token
    assert len(one.token) >= 43  # 256 bits
    assert one.is_token(one.token)
    for wrong in (None, "", one.token[:-1], one.token + "x", other.token, "é"):
        assert not one.is_token(wrong)


@pytest.mark.parametrize(
    "path",
    [
        "/../../etc/passwd",
        "/%2e%2e/%2e%2e/etc/passwd",
        "/..%2f..%2fetc%2fpasswd",
        "//etc/passwd",
        "/__init__.py",
        "/examples/three.html",
        "/app.js%00.html",
    ],
)
def test_no_request_names_a_file(path):
    with served() as (_, site):
        status, _, body = site.get(path, **site.bearer)
        assert status in (400, 404)
        assert b"root:" not in body


@pytest.mark.parametrize("path", ["/", "/app.js", "/nothing"])
def test_every_answer_forbids_what_the_page_does_not_need(path):
    with served() as (_, site):
        _, headers, _ = site.get(path, **site.bearer)
    policy = headers["Content-Security-Policy"]
    assert policy.startswith("default-src 'none'; script-src 'self'")
    assert "unsafe" not in policy
    assert "frame-ancestors 'none'" in policy
    assert headers["X-Content-Type-Options"] == "nosniff"
    assert headers["Cache-Control"] == "no-store"
    assert "Access-Control-Allow-Origin" not in headers


def test_the_page_s_parts_hold_no_foreign_address():
    with served() as (_, site):
        for part in ("", "app.js", "connection.js", "controls.js", "map.js", "style.css"):
            status, _, body = site.get(f"/{part}", **site.bearer)
            assert status == 200
            assert b"https://" not in body
            assert b"//cdn" not in body


@pytest.mark.parametrize(
    "sent",
    [
        "x" * (MOST_MESSAGE_BYTES + 1),
        "not json",
        '{"set": 3}',
        '{"ask": "rm -rf"}',
        '{"path": "/etc/passwd"}',
        "[" * 2000,
        b"\x00\x01",
    ],
)
def test_what_is_not_understood_closes_the_connection(sent):
    async def say(ws):
        await (ws.send_bytes(sent) if isinstance(sent, bytes) else ws.send_str(sent))
        return await close_code(ws)

    with served() as (desk, site):
        assert site.talk(say, **site.bearer) in (1008, 1009)
        assert desk.settings == Settings()
        assert desk.requests() == []


def test_a_setting_out_of_range_is_answered_and_not_taken():
    async def say(ws):
        await ws.send_str(json.dumps({"set": {"count": 10**9}}))
        await ws.send_str(json.dumps({"set": {"model": "/etc/passwd"}}))
        await asyncio.sleep(0.2)

    with served() as (desk, site):
        site.talk(say, **site.bearer)
        assert desk.settings == Settings()
        assert desk.notice.number == 2
        assert desk.notice.is_error


def test_too_many_messages_close_the_connection():
    async def flood(ws):
        for _ in range(1000):
            await ws.send_str('{"shown": 1}')
        return await close_code(ws)

    with served() as (_, site):
        assert site.talk(flood, **site.bearer) == 1008


def test_a_page_that_shows_all_it_can_and_drags_a_slider_may_go_on():
    now_s = 0.0
    allowance = Allowance(now_s=lambda: now_s)
    for number in range(20 * (120 + 30)):
        now_s = number / (120 + 30)
        assert allowance.take()


def test_an_allowance_fills_again_with_time():
    now_s = 0.0
    allowance = Allowance(rate_hz=10.0, burst=3, now_s=lambda: now_s)
    assert [allowance.take() for _ in range(4)] == [True, True, True, False]
    now_s = 0.1001
    assert [allowance.take() for _ in range(2)] == [True, False]
    now_s = 1000.0
    assert [allowance.take() for _ in range(4)] == [True, True, True, False]


@pytest.mark.parametrize("path", ["view", "lights"])
def test_there_is_a_limit_to_clients_and_who_leaves_makes_room(path):
    async def crowd(ws):
        async with aiohttp.ClientSession(headers=site.bearer) as session:
            others = [
                await session.ws_connect(f"http://{site.host}/{path}") for _ in range(MOST_CLIENTS)
            ]
            refused = await close_code(others[-1])
            await others[0].close()
            await asyncio.sleep(0.1)
            late = await session.ws_connect(f"http://{site.host}/{path}")
            with pytest.raises(TimeoutError):  # nothing comes, not even a closing
                await asyncio.wait_for(late.receive(), 0.2)
            for other in (*others, late):
                await other.close()
            return refused

    with served() as (_, site):
        assert site.talk(crowd, path, **site.bearer) == 1013


def test_followers_have_nothing_to_say():
    async def say(ws):
        await ws.send_str('{"set": {"count": 1}}')
        return await close_code(ws)

    with served() as (desk, site):
        assert site.talk(say, "lights", **site.bearer) == 1008
        assert desk.settings.count == 64


def test_one_that_never_reads_holds_nobody_up_and_is_sent_little():
    """A client that does not say what it showed is sent two moments, however many there are."""

    async def watch(ws):
        async with aiohttp.ClientSession(headers=site.bearer) as session:
            sleeper = await session.ws_connect(f"http://{site.host}/view")
            seen = []
            for number in range(1, 21):
                desk.publish(State("running"), moment(number), 0.0, {})
                message = await ws.receive()
                length = int.from_bytes(message.data[:4], "little")
                seen.append(json.loads(message.data[4 : 4 + length])["number"])
                await ws.send_str(json.dumps({"shown": seen[-1]}))
            received = []
            with suppress(TimeoutError):
                while True:
                    received.append(await asyncio.wait_for(sleeper.receive(), 0.3))
            await sleeper.close()
            return seen, len(received)

    with served() as (desk, site):
        seen, received = site.talk(watch, **site.bearer)
    assert seen == sorted(set(seen))
    assert seen[-1] == 20
    assert received == 2


def test_publishing_does_not_wait_for_anyone():
    """Nor does it keep what nobody fetched: a thousand moments, with a client that never reads."""

    async def sleep_through(_ws):
        begin_s = time.thread_time()
        frames = [moment(1)] * 1000

        def publish():
            for seen in frames:
                desk.publish(State("running"), seen, 0.0, {})

        thread = threading.Thread(target=publish)
        thread.start()
        await asyncio.to_thread(thread.join, 5.0)
        return not thread.is_alive() and time.thread_time() - begin_s < 2.0

    with served() as (desk, site):
        assert site.talk(sleep_through, **site.bearer)
        assert desk.newest.number == 1000


def test_a_port_that_is_taken_is_told():
    with served() as (_, site):
        desk = Desk(Settings(), MODELS)
        with (
            pytest.raises(InputError, match=f"--port {site.port}"),
            LiveServer(desk, Access(), site.port),
        ):
            pass


@pytest.mark.parametrize("host", ["a..b", "x" * 70])
def test_a_host_that_is_no_name_is_told(host):
    with (
        pytest.raises(InputError, match=f"--host {host}"),
        LiveServer(Desk(Settings(), MODELS), Access(host)),
    ):
        pass


def test_a_defect_while_a_moment_is_made_into_messages_is_told_at_once_and_raised(monkeypatch):
    def fail(_frame, _desk):
        raise ZeroDivisionError("a defect")

    monkeypatch.setattr("render.live.server.encode_frame", fail)
    told, desk = threading.Event(), Desk(Settings(), MODELS)

    async def watch(_ws):
        desk.publish(State("running"), moment(), 0.0, {})
        return await asyncio.to_thread(told.wait, 5.0)

    def follow():
        with LiveServer(desk, Access(), on_defect=told.set) as server:
            assert Site(server).talk(watch, **Site(server).bearer)

    with pytest.raises(ZeroDivisionError):
        follow()


def test_the_server_s_thread_ends_with_it():
    with served():
        pass
    assert not any(thread.name.startswith("fishlight-server") for thread in threading.enumerate())
