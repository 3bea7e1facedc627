"""The examples that follow a session do with its lights what they say.

Blender's module is not to be had here: what the script writes to it is recorded.
"""

import importlib.util
import json
import math
import queue
import sys
from pathlib import Path
from types import ModuleType, SimpleNamespace

import numpy as np
import pytest

from lighting.light_set import LightSet
from render.live.access import Access
from render.live.desk import Desk, LiveFrame, Seen, State
from render.live.models import load_models
from render.live.server import LiveServer
from render.live.settings import Settings
from render.live.stream import stream_message

EXAMPLES = Path(__file__).resolve().parents[2] / "render" / "viewer" / "examples"


class Items(dict):
    """bpy.data.lights and its like, as far as the script uses them."""

    def __init__(self, make):
        super().__init__()
        self._make = make

    def new(self, name, *arguments):
        self[name] = self._make(name, *arguments)
        return self[name]


class Linked(list):
    link = list.append


def collection_of(name):
    return SimpleNamespace(name=name, objects=Linked(), children=Linked())


def world_of(name):
    colour = SimpleNamespace(default_value=(0, 0, 0, 1))
    background = SimpleNamespace(inputs={"Color": colour})
    return SimpleNamespace(name=name, node_tree=SimpleNamespace(nodes={"Background": background}))


@pytest.fixture
def script(monkeypatch):
    bpy = ModuleType("bpy")
    bpy.data = SimpleNamespace(
        lights=Items(lambda name, kind: SimpleNamespace(name=name, type=kind)),
        objects=Items(lambda name, data: SimpleNamespace(name=name, data=data)),
        collections=Items(collection_of),
        worlds=Items(world_of),
    )
    bpy.context = SimpleNamespace(
        scene=SimpleNamespace(collection=collection_of("scene"), world=None)
    )
    monkeypatch.setitem(sys.modules, "bpy", bpy)
    spec = importlib.util.spec_from_file_location("follow", EXAMPLES / "blender_follow.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def message(directions, irradiance, radius_rad=0.0, state="running", fill=None):
    directions = np.asarray(directions, float).reshape(-1, 3)
    lights = LightSet(
        directions,
        np.asarray(irradiance, float).reshape(-1, 3),
        np.full(len(directions), radius_rad),
        **({} if fill is None else {"fill": fill}),
    )
    seen = Seen(lights, None, None, None, 0.0, False)
    return json.loads(stream_message(LiveFrame(1, State(state), seen, 0.0, 0.0, {})))


def turned(quaternion, vector):
    w, *axis = quaternion
    axis, vector = np.array(axis), np.array(vector, float)
    t = 2 * np.cross(axis, vector)
    return vector + w * t + np.cross(axis, t)


@pytest.mark.parametrize(
    ("ours", "blenders"),
    [
        ((0, 1, 0), (0, 0, 1)),
        ((0, -1, 0), (0, 0, -1)),
        ((1, 0, 0), (1, 0, 0)),
        ((0, 0, 1), (0, -1, 0)),
        ((0.6, 0.0, -0.8), (0.6, 0.8, 0.0)),
    ],
)
def test_a_sun_shines_from_where_the_light_is(script, ours, blenders):
    script.show(message(ours, [1, 1, 1]))
    (lamp,) = script.bpy.data.collections["fishlight"].objects
    shines = turned(lamp.rotation_quaternion, (0, 0, -1))
    np.testing.assert_allclose(shines, -np.array(blenders), atol=1e-12)


def test_strength_colour_and_angle_are_the_light_s(script):
    script.show(message((0, 1, 0), [2.0, 4.0, 1.0], radius_rad=0.5))
    (lamp,) = script.bpy.data.collections["fishlight"].objects
    assert lamp.data.type == "SUN"
    assert lamp.data.angle == 1.0
    np.testing.assert_allclose(
        np.multiply(lamp.data.color, lamp.data.energy),
        np.array([2.0, 4.0, 1.0]) * (1 + math.cos(0.5)) / 2,  # ∫ cos over the disc
    )


def test_lights_that_went_are_hidden_and_come_back(script):
    script.show(message(np.eye(3), np.ones((3, 3))))
    script.show(message([[0, 1, 0]], [[1, 1, 1]]))
    lamps = script.bpy.data.collections["fishlight"].objects
    assert [lamp.hide_render for lamp in lamps] == [False, True, True]
    script.show(message(np.eye(3), np.ones((3, 3))))
    assert [lamp.hide_render for lamp in lamps] == [False] * 3
    assert len(script.bpy.context.scene.collection.children) == 1


def test_what_is_not_valid_changes_nothing(script):
    script.show(message([[0, 1, 0]], [[1, 1, 1]]))
    script.show(message([[1, 0, 0]], [[9, 9, 9]], state="clipped"))
    (lamp,) = script.bpy.data.collections["fishlight"].objects
    assert lamp.data.energy == 1.0


def test_the_fill_s_mean_is_the_world_s_colour(script):
    fill = np.zeros((9, 3))
    fill[0] = math.sqrt(4 * math.pi) * np.array([0.1, 0.2, 0.3])  # radiance 0.1, 0.2, 0.3
    script.show(message([[0, 1, 0]], [[1, 1, 1]], fill=fill))
    colour = script.bpy.context.scene.world.node_tree.nodes["Background"].inputs["Color"]
    np.testing.assert_allclose(colour.default_value, (0.1, 0.2, 0.3, 1.0))


def test_it_follows_a_session_and_a_recording_of_one(script, tmp_path):
    desk = Desk(Settings(), load_models(()))
    lights = LightSet(np.array([[0.0, 1.0, 0.0]] * 900), np.ones((900, 3)), np.zeros(900))
    with LiveServer(desk, Access()) as server:
        desk.publish(State("running"), Seen(lights, None, None, None, 0.0, False), 0.0, {})
        received = next(script.received(server.address))  # more than 65,535 bytes
    assert len(received["lights"]["lights"]) == 900
    path = tmp_path / "lights.jsonl"
    path.write_text("".join(json.dumps({**received, "frame": n}) + "\n" for n in range(3)))
    newest = queue.Queue(maxsize=1)
    script.follow(str(path), newest)
    assert newest.get_nowait()["frame"] == 2, "the newest"
