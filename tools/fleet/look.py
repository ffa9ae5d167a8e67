"""A look at who is there at an endpoint: a drone's hub, or a router."""

import time
from collections import deque

from services.runtime.bus.key_files import KeyFiles
from services.runtime.bus.network import open_network
from services.runtime.bus.spaces import here_of
from tools.fleet.roster import ROWS, Roster

LOOK_S = 1.6  # [s] who is there says so once a second
STEP_S = 0.01  # [s] between two looks at what has arrived
PATIENCE_S = 1.0  # [s] for the endpoint to answer


def who_is_there(endpoint: str, keys: KeyFiles | None = None) -> list[str]:
    """Names of the drones that are announced now.

    Raises:
        LindyError: nobody answers there, or nobody who lets us in.
    """
    with open_network(endpoint, PATIENCE_S, keys=keys) as network:
        roster = Roster()
        for key in network.tokens():
            roster.token(key)
        return roster.names


def is_there(name: str, endpoint: str, keys: KeyFiles | None = None) -> bool:
    """Is a drone of this name announced now?

    Raises:
        LindyError: nobody answers there, or nobody who lets us in.
    """
    with open_network(endpoint, PATIENCE_S, keys=keys) as network:
        found = [here_of(key) for key in network.tokens(name)]
        return any(here is not None and here.name == name for here in found)


def look(endpoint: str, keys: KeyFiles | None = None, longest_s: float = LOOK_S) -> Roster:
    """Everything that is to be known of the drones that are there. Returns as soon as all of them
    have spoken, at the latest after `longest_s`.

    Raises:
        LindyError: nobody answers there, or nobody who lets us in.
    """
    roster = Roster()
    heard: deque[tuple[str, bytes]] = deque(maxlen=10_000)  # filled on Zenoh's thread
    with open_network(endpoint, PATIENCE_S, keys=keys) as network:
        for topic in ROWS:
            network.hear(topic, lambda key, payload: heard.append((key, payload)))
        for key in network.tokens():
            roster.token(key)
        deadline = time.monotonic() + longest_s
        while not roster.complete and time.monotonic() < deadline:
            time.sleep(STEP_S)  # messages come on Zenoh's thread
            while heard:
                roster.row(*heard.popleft())
    return roster
