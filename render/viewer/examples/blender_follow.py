"""Light a Blender scene from a live session.

    blender scene.blend -P blender_follow.py -- ADDRESS

ADDRESS is what `fishlight live` prints, or a file that `fishlight follow ADDRESS -o FILE` records:
its moments are then played as they came. Blender 4 and later; nothing else is needed.

Each light becomes a Sun in the collection "fishlight", the fill the colour of the world. Our
(x, y, z) is Blender's (x, −z, y); a Sun shines along its own −Z, its strength is the irradiance on
a surface that faces it, and its angle a full diameter. A harmonic fill has no counterpart in
Blender's suns: its mean is the world's colour, and its directions are lost.
"""

import base64
import json
import math
import os
import queue
import socket
import struct
import sys
import threading
from contextlib import suppress
from urllib.parse import parse_qs, urlsplit

import bpy

COLLECTION = "fishlight"
SCHEMA = "fishlight-light-stream/1"
EVERY_S = 0.04


def main(source):
    """Follow `source`, and show the newest moment at each tick of Blender's timer."""
    newest = queue.Queue(maxsize=1)
    threading.Thread(target=follow, args=(source, newest), daemon=True).start()

    def tick():
        with suppress(queue.Empty):
            show(newest.get_nowait())
        return EVERY_S

    bpy.app.timers.register(tick)


def show(message):
    """Make the scene's lights those of a message of the stream; stale and invalid ones stay."""
    if not message["schema"].startswith(SCHEMA) or not message["valid"]:
        return
    lights = message["lights"]
    suns = [light for light in lights["lights"] if max(light["irradiance"]) > 0]
    collection = _collection()
    lamps = sorted(collection.objects, key=lambda lamp: lamp.name)
    for index in range(len(lamps), len(suns)):
        name = f"fishlight {index:03d}"
        lamp = bpy.data.objects.new(name, bpy.data.lights.new(name, "SUN"))
        lamp.rotation_mode = "QUATERNION"
        collection.objects.link(lamp)
        lamps.append(lamp)
    for lamp, light in zip(lamps, suns, strict=False):
        strength = max(light["irradiance"])
        radius = min(light["angular_radius_rad"], math.pi / 2)
        lamp.data.energy = strength * (1 + math.cos(radius)) / 2
        lamp.data.color = [value / strength for value in light["irradiance"]]
        lamp.data.angle = 2 * radius
        lamp.rotation_quaternion = facing(light["direction"])
        lamp.hide_viewport = lamp.hide_render = False
    for lamp in lamps[len(suns) :]:
        lamp.hide_viewport = lamp.hide_render = True
    _show_fill(lights["fill"])


def facing(direction):
    """Return the quaternion (w, x, y, z) that turns +Z toward a direction of ours."""
    x, y, z = direction[0], -direction[2], direction[1]
    if z < -1 + 1e-12:
        return (0.0, 1.0, 0.0, 0.0)
    w = math.sqrt((1 + z) / 2)
    return (w, -y / (2 * w), x / (2 * w), 0.0)


def _collection():
    found = bpy.data.collections.get(COLLECTION)
    if found is None:
        found = bpy.data.collections.new(COLLECTION)
        bpy.context.scene.collection.children.link(found)
    return found


def _show_fill(fill):
    mean = [value * math.sqrt(1 / (4 * math.pi)) for value in fill[0]] if fill else [0, 0, 0]
    world = bpy.context.scene.world or bpy.data.worlds.new(COLLECTION)
    bpy.context.scene.world = world
    world.use_nodes = True
    world.node_tree.nodes["Background"].inputs["Color"].default_value = (*mean, 1)


def follow(source, newest):
    """Put message after message into `newest`, in place of what was not taken."""
    messages = recorded(source) if os.path.exists(source) else received(source)
    for message in messages:
        with suppress(queue.Empty):
            newest.get_nowait()
        newest.put(message)


def recorded(path):
    """Yield the moments of a recording, each as long after the last as it came."""
    last_s = None
    with open(path, encoding="utf-8") as lines:
        for line in lines:
            message = json.loads(line)
            if last_s is not None:
                threading.Event().wait(min(max(message["time_s"] - last_s, 0.0), 1.0))
            last_s = message["time_s"]
            yield message


def received(address):
    """Yield what a session sends: a WebSocket (RFC 6455), of which only text is needed."""
    parts = urlsplit(address)
    token = parse_qs(parts.query)["token"][0]
    with socket.create_connection((parts.hostname, parts.port), timeout=30) as connection:
        key = base64.b64encode(os.urandom(16)).decode()
        lines = [
            "GET /lights HTTP/1.1",
            f"Host: {parts.netloc}",
            "Upgrade: websocket",
            "Connection: Upgrade",
            f"Sec-WebSocket-Key: {key}",
            "Sec-WebSocket-Version: 13",
            f"Authorization: Bearer {token}",
        ]
        connection.sendall(("\r\n".join(lines) + "\r\n\r\n").encode())
        stream = connection.makefile("rb")
        status = stream.readline().decode().strip()
        if " 101 " not in f"{status} ":
            raise RuntimeError(f"{parts.netloc}: {status}")
        while stream.readline().strip():
            pass
        while True:
            kind, data = _frame(stream)
            if kind == 0x1:
                yield json.loads(data)
            elif kind == 0x9:
                connection.sendall(_masked(0xA, data))
            elif kind == 0x8:
                return


def _frame(stream):
    """Return opcode and content of a frame; servers send a message in one, unmasked."""
    first, second = stream.read(2)
    length = second & 0x7F
    if length == 126:
        (length,) = struct.unpack(">H", stream.read(2))
    elif length == 127:
        (length,) = struct.unpack(">Q", stream.read(8))
    return first & 0x0F, stream.read(length)


def _masked(kind, data):
    mask = os.urandom(4)
    body = bytes(value ^ mask[index % 4] for index, value in enumerate(data))
    return bytes([0x80 | kind, 0x80 | len(data)]) + mask + body


if __name__ == "__main__":
    main(sys.argv[sys.argv.index("--") + 1])
