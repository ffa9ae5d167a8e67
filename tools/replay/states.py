"""What today's estimation makes of a recording that has no state, such as an imported one."""

from collections.abc import Iterator
from pathlib import Path

import msgspec

from messages import topics
from messages.state import VehicleState
from services.runtime.hosts.garbage_collection import rare_collections
from services.runtime.hosts.registry import Registry
from tools.replay.on_board import OnBoard
from tools.replay.source import open_source


def states_of_today(recording: Path) -> Iterator[VehicleState]:
    """In the order of their samples, stamps by the services' clock.

    Raises:
        LindyError: it is no recording, or its vehicle is not in it.
    """
    source = open_source(recording)
    with source.stack() as stack, rare_collections():
        replay = OnBoard(source, ("estimation",), Registry.read("simulated"), stack)
        replay.run(source.span[1])
    decode = msgspec.json.Decoder(VehicleState).decode
    return (decode(told.data) for told in replay.outputs.of(topics.STATE.key))
