"""The stream of lights: what a follower reads is what lights.json would hold, and is as marked."""

import json
import threading

import numpy as np
import pytest

from capture.errors import InputError
from lighting.light_files import lights_object, read_lights, write_lights
from render.live.access import Access
from render.live.desk import Desk, LiveFrame, Seen, State
from render.live.following import TOKEN_VARIABLE, StreamLost, follow, parse_address
from render.live.models import load_models
from render.live.server import LiveServer
from render.live.settings import Settings
from render.live.stream import SCHEMA, stream_message
from render.main import main
from tests.lighting_sets import random_set

LIGHTS = random_set(np.random.default_rng(5), 9, timestamp_s=12.5)


def seen(lights=LIGHTS):
    return Seen(lights, None, None, None, 0.0, False)


def frame(state="running", shown=seen()):  # noqa: B008 - nothing changes it
    return LiveFrame(7, State(state), shown, 0.25, 0.0, {})


def leave_soon(server):
    """End the block of a server, on a thread of its own: the caller is one of its clients."""
    threading.Thread(target=server.__exit__, args=(None, None, None)).start()


def test_the_lights_are_those_of_lights_json(tmp_path):
    path = tmp_path / "lights.json"
    write_lights(path, LIGHTS)
    assert lights_object(LIGHTS) == json.loads(path.read_text())
    path.write_text(json.dumps(json.loads(stream_message(frame()))["lights"]))
    again = read_lights(path)
    for name in ("directions", "irradiance", "angular_radius_rad", "is_key", "fill"):
        np.testing.assert_array_equal(getattr(again, name), getattr(LIGHTS, name))


@pytest.mark.parametrize(
    ("state", "is_stale", "is_valid"),
    [
        ("running", False, True),
        ("away", True, True),
        ("clipped", False, False),
        ("dark", False, False),
        ("no-camera", True, False),
        ("ended", True, True),
    ],
)
def test_marks_say_whether_to_believe_it(state, is_stale, is_valid):
    message = json.loads(stream_message(frame(state)))
    assert (message["stale"], message["valid"]) == (is_stale, is_valid)
    assert message["schema"] == SCHEMA
    assert (message["frame"], message["time_s"], message["age_s"]) == (7, 12.5, 0.25)


def test_before_the_first_lights_there_are_none_and_it_is_not_valid():
    message = json.loads(stream_message(frame("running", None)))
    assert message["lights"] is None
    assert not message["valid"]


def test_a_follower_gets_each_moment_it_is_there_for_and_ends_with_the_session():
    desk = Desk(Settings(), load_models(()))
    frames, states = [], []

    def take(text, message):
        assert json.loads(text)["lights"] == message.lights
        frames.append(message.frame)
        states.append(message.state)
        state = "ended" if len(frames) == 3 else "running"
        desk.publish(State(state), seen(), 0.0, {})
        return True

    with LiveServer(desk, Access()) as server:
        desk.publish(State("starting"), None, 0.0, {})
        follow(server.address, take)
    assert frames == [1, 2, 3, 4]
    assert states == ["starting", "running", "running", "ended"]


def test_how_a_session_ended_is_still_sent():
    desk = Desk(Settings(), load_models(()))
    states = []

    def take(_text, message):
        states.append(message.state)
        if message.state == "running":
            desk.publish(State("ended"), seen(), 0.0, {})
            leave_soon(server)
        return True

    server = LiveServer(desk, Access()).__enter__()
    desk.publish(State("running"), seen(), 0.0, {})
    follow(server.address, take)
    assert states == ["running", "ended"]


def test_a_follower_that_had_enough_leaves():
    desk = Desk(Settings(), load_models(()))
    with LiveServer(desk, Access()) as server:
        desk.publish(State("running"), seen(), 0.0, {})
        texts = []
        follow(server.address, lambda text, _message: texts.append(text) is not None)
    assert len(texts) == 1


def test_a_server_that_ends_is_told():
    desk = Desk(Settings(), load_models(()))
    server = LiveServer(desk, Access()).__enter__()
    desk.publish(State("running"), seen(), 0.0, {})

    def take(_text, _message):
        leave_soon(server)
        return True

    with pytest.raises(StreamLost, match="has ended"):
        follow(server.address, take)


def test_a_wrong_token_or_no_session_is_one_line(monkeypatch):
    monkeypatch.delenv(TOKEN_VARIABLE, raising=False)
    desk = Desk(Settings(), load_models(()))
    with LiveServer(desk, Access()) as server:
        base = server.address.partition("?")[0]
        with pytest.raises(InputError, match="token is wrong or old"):
            follow(f"{base}?token=x", lambda *_: True)
    with pytest.raises(InputError, match="no session is there"):
        follow(f"{base}?token=x", lambda *_: True)
    with pytest.raises(InputError, match=TOKEN_VARIABLE):
        follow(base, lambda *_: True)


def test_an_address_is_read_with_or_without_its_token(monkeypatch):
    monkeypatch.setenv(TOKEN_VARIABLE, "secret")
    assert parse_address("http://h:1/?token=t") == ("http://h:1/lights", "t")
    assert parse_address("h:1") == ("http://h:1/lights", "secret")
    for address in ("ftp://h:1", "http://[?token=t", "h:port"):
        with pytest.raises(InputError, match="wanted the address"):
            parse_address(address)


def test_an_address_where_nobody_is_leaves_an_older_file_alone(tmp_path, capsys):
    older, new = tmp_path / "older.jsonl", tmp_path / "new.jsonl"
    older.write_text("of yesterday\n")
    for path in (older, new):
        with pytest.raises(SystemExit):
            main(["follow", "http://127.0.0.1:9/?token=t", "-o", str(path), "--force"])
    assert older.read_text() == "of yesterday\n"
    assert not new.exists()
    assert "no session is there" in capsys.readouterr().err


def test_the_command_records_lines_of_json(tmp_path, capsys):
    desk = Desk(Settings(), load_models(()))
    path = tmp_path / "lights.jsonl"
    with LiveServer(desk, Access()) as server:
        desk.publish(State("running"), seen(), 0.0, {})
        for arguments in (["-o", str(path)], []):
            with pytest.raises(SystemExit) as end:
                main(["follow", server.address, "--moments", "1", *arguments])
            assert not end.value.code
    (line,) = path.read_text().splitlines()
    assert json.loads(line)["lights"] == lights_object(LIGHTS)
    printed = capsys.readouterr().out
    assert f"{path}: moments 1" in printed
    assert "running, valid: lights 9" in printed
