"""A session in somebody else's Zenoh network, over real Zenoh on this machine."""

import json
from collections.abc import Generator
from contextlib import contextmanager
from typing import Any

import zenoh

from services.runtime.bus.other_network import LONGEST, OtherNetwork
from tests.support.doors import free_port
from tests.support.patience import until


@contextmanager
def router(port: int) -> Generator[zenoh.Session]:
    """As rmw_zenohd."""
    settings = zenoh.Config()
    listen = {"listen/endpoints": [f"tcp/127.0.0.1:{port}"], "mode": "router"}
    for key, value in {**listen, "scouting/multicast/enabled": False}.items():
        settings.insert_json5(key, json.dumps(value))
    with zenoh.open(settings) as session:
        yield session


def test_what_was_declared_is_there_once_the_router_is_and_again_after_it_was_gone() -> None:
    port = free_port()
    network = OtherNetwork(f"tcp/127.0.0.1:{port}", "ros2.router")
    got: list[tuple[str, bytes, bytes]] = []
    publisher = network.publisher("0/out")
    network.hear("0/in", lambda key, payload, attached: got.append((key, payload, attached)))
    token = f"@ros2_lv/0/{network.session_id}/0/0/NN/%/%/lindy"
    network.announce(token)
    network.start()
    try:
        publisher.put(b"nobody is there", b"")
        assert not network.connected
        for _ in range(2):  # the second is another router, at the same place
            with router(port) as other:
                heard: list[zenoh.Sample] = []
                until(lambda: network.connected)
                assert not publisher.heard
                subscriber = other.declare_subscriber("0/out", heard.append)
                until(lambda publisher=publisher: publisher.heard)
                publisher.put(b"payload", b"attached")
                until(lambda heard=heard: heard)
                attached = heard[0].attachment
                assert heard[0].payload.to_bytes() == b"payload"
                assert attached is not None
                assert attached.to_bytes() == b"attached"
                there = [str(r.ok.key_expr) for r in other.liveliness().get("@ros2_lv/**") if r.ok]
                assert there == [token]
                got.clear()
                blocks = zenoh.CongestionControl.BLOCK  # else a busy computer drops it
                # Its stub calls `matching` a bool.
                sender: Any = other.declare_publisher("0/in", congestion_control=blocks)
                until(lambda sender=sender: sender.matching_status.matching)
                sender.put(b"x" * (LONGEST + 1))
                sender.put(b"hello", attachment=b"a")
                until(lambda: got)
                assert got == [("0/in", b"hello", b"a")]
                subscriber.undeclare()
                until(lambda publisher=publisher: not publisher.heard)
            until(lambda: not network.connected)
        assert network.too_long == 2
    finally:
        network.close()


def test_it_can_be_closed_while_nobody_answers() -> None:
    network = OtherNetwork(f"tcp/127.0.0.1:{free_port()}", "ros2.router")
    network.start()
    network.close()
    assert not network.connected
