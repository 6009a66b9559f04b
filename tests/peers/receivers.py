"""Prints what a client of one protocol receives, a line each, until it is killed.

python receivers.py osc|tuio|foxglove|dds PORT_OR_DOMAIN
"""

import json
import sys
import time
from collections.abc import Iterator


def osc(port: int) -> None:
    from pythonosc.dispatcher import Dispatcher
    from pythonosc.osc_server import BlockingOSCUDPServer

    dispatcher = Dispatcher()
    dispatcher.map("/manytouch/contact", lambda _, *values: show(values[5]))
    BlockingOSCUDPServer(("127.0.0.1", port), dispatcher).serve_forever()


def tuio(port: int) -> None:
    import pythontuio

    client = pythontuio.TuioClient(("127.0.0.1", port))

    class Listener(pythontuio.TuioListener):
        def refresh(self, time) -> None:
            for cursor in client.cursors:
                show(cursor.position[0])

    client.add_listener(Listener())
    client.start()


def foxglove(port: int) -> None:
    from websockets.sync.client import connect

    with connect(f"ws://127.0.0.1:{port}", subprotocols=["foxglove.sdk.v1"]) as socket:
        topics: dict[str, int] = {}
        while "/reading" not in topics:
            message = json.loads(socket.recv())
            topics |= {each["topic"]: each["id"] for each in message.get("channels", [])}
        wanted = [{"id": 1, "channelId": topics["/reading"]}]
        socket.send(json.dumps({"op": "subscribe", "subscriptions": wanted}))
        for message in socket:
            if isinstance(message, bytes):
                show(json.loads(message[13:])["contacts"][0]["normal_force_N"])


def dds(domain: int) -> None:
    from manytouch.sinks.publishers.dds import DdsParticipant

    peer = DdsParticipant(domain)
    reader = peer.reader("/skin/wrench", "geometry_msgs/msg/WrenchStamped", is_reliable=False)
    for message in taken(reader):
        show(message.wrench.force.z)


def taken(reader) -> Iterator:
    while True:
        yield from reader.take(N=10)
        time.sleep(0.01)


def show(value: float) -> None:
    print(f"value {value}", flush=True)


{"osc": osc, "tuio": tuio, "foxglove": foxglove, "dds": dds}[sys.argv[1]](int(sys.argv[2]))
