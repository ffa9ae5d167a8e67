"""Foxglove service: what the recorder writes, live, for any number of viewers. It publishes nothing
but its health, and whoever watches can command nothing."""

import msgspec

from messages import events
from messages.message import Message
from messages.topic import AnyTopic
from services.foxglove.core import LOOPBACK, Settings
from services.marine.vehicle import Vehicle
from services.recorder.foxglove.channel import schema_of
from services.recorder.foxglove.views import Views
from services.runtime.config.errors import LindyError, NeedsRealTimeError
from services.runtime.config.extras import how_to_install
from services.runtime.config.stack import Stack
from services.runtime.node.node import Node

LATEST_NS = 2**63 - 1  # [ns] the protocol has unsigned times, viewers signed ones
SHOW_HZ = 25.0  # [1/s] how often what has arrived is sent on


def wire(node: Node, stack: Stack) -> None:
    if stack.virtual:
        raise NeedsRealTimeError("foxglove")
    try:
        from services.foxglove.io.server import FoxgloveServer
    except ImportError:
        raise LindyError(
            f"foxglove needs the foxglove-sdk, which is not installed; {how_to_install('foxglove')}"
        ) from None
    settings = stack.section("foxglove", Settings)
    server = FoxgloveServer(settings.host, settings.port, f"lindy {stack.vehicle_name}")
    node.on_close(server.close)
    node.log("info", f"Foxglove connects to ws://{settings.host}:{settings.port}")
    if settings.host not in LOOPBACK:
        node.log("warning", f"whoever reaches port {settings.port} can watch this dive")
    views, encode = Views(stack.section("vehicle", Vehicle)), msgspec.json.Encoder().encode

    def show(topic: AnyTopic, key: str, message: Message, _: int) -> None:
        utc_ns = message.stamp_ns + node.wall_offset_ns
        if not 0 <= utc_ns <= LATEST_NS:
            node.tell(events.MALFORMED(topic.key))
            return
        channel = server.channel(key, schema_of(topic.message))
        if channel.has_sinks():  # nobody watches most channels
            channel.log(encode(message), log_time=utc_ns)
        for view in views.of(topic, message, utc_ns, key):
            server.channel(view.key, view.schema).log(view.data, log_time=utc_ns)

    node.watch(show)
    node.every(SHOW_HZ, lambda _: None)  # a step of the node hands over what has arrived
