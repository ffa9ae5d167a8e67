"""Where drone and topside meet, and by which name: what is settled before a side starts."""

import time
from pathlib import Path
from socket import gethostname
from typing import NamedTuple

from services.runtime.bus.key_files import Credentials, KeyFiles
from services.runtime.bus.spaces import checked_name
from services.runtime.bus.zenoh_bus import NobodyThereError
from services.runtime.config.errors import LindyError
from services.runtime.config.stack import Stack
from tools.fleet.look import who_is_there
from tools.fleet.names import in_words, own_name
from tools.keys.credentials import credentials, is_local

AGAIN_S = 0.5  # [s] between two questions who is there
GONE_S = 3.0  # [s] in which an earlier start of this drone, cut off, is forgotten by the network


class Meeting(NamedTuple):
    """Where a drone can be reached: at its own endpoint, by way of a router, or both."""

    listen: str | None
    router: str | None
    credentials: Credentials | None

    @property
    def link(self) -> str:
        """In words."""
        return " and ".join(filter(None, (self.listen, self.router)))

    @property
    def keys(self) -> KeyFiles | None:
        return None if self.credentials is None else self.credentials.keys


def drones_credentials(
    listen: str | None, router: str | None, keys: Path | None, *, insecure: bool
) -> Credentials | None:
    """The keys of a drone, for its own endpoint and for a router.

    Raises:
        LindyError: an endpoint needs keys, only one of both does, or the keys are no good.
    """
    found_for = {
        option: credentials(endpoint, option, ("drone",), keys, insecure=insecure)
        for option, endpoint in (("--listen", listen), ("--router", router))
        if endpoint is not None
    }
    if len(found_for) == 2 and None in found_for.values() and any(found_for.values()):
        raise LindyError(f"--listen {listen} and --router {router}: both with tls, or none of them")
    return next(iter(found_for.values()))


def drones_name(stack: Stack, meeting: Meeting) -> str:
    """The name that was given to a drone, else that of its keys, else one by its computer.

    Raises:
        LindyError: whoever compares names with keys would not let it in, or a drone cannot be
            called this.
    """
    keys_name = "" if meeting.credentials is None else meeting.credentials.name
    name = stack.name or keys_name or own_name(stack.vehicle_name, gethostname())
    if keys_name not in ("", name):
        raise LindyError(
            f"--name {name}: this machine's keys are those of drone:{keys_name}, and it is "
            f"believed by that name only; leave --name out, or use keys of drone:{name}"
        )
    return checked_name(name, "--name")


def require_only(name: str, router: str, keys: KeyFiles | None) -> None:
    """Check that no other drone of this name is on the network. A router that is away must not keep
    a drone from its start: it joins when the router comes.

    Raises:
        LindyError: there is one; it goes on undisturbed.
    """
    deadline = time.monotonic() + GONE_S
    try:
        while name in who_is_there(router, keys, name):
            if time.monotonic() > deadline:
                raise TakenNameError(
                    f"a drone called {name} is on the network of {router} already, and goes on; "
                    f"give this one another --name"
                )
            time.sleep(AGAIN_S)  # an earlier start of this drone may not be forgotten yet
    except NobodyThereError:
        print(f"no router answers at {router} yet: {name} joins when one does", flush=True)
    except TakenNameError:
        raise
    except LindyError as error:
        print(f"{error}; {name} goes on without, and tries again and again", flush=True)


class TakenNameError(LindyError):
    """Another drone has this name."""


def drone_at(endpoint: str, own: str, keys: KeyFiles | None) -> str:
    """The name of the one drone that is there. On this machine the drone may be started later: it
    will be called by this machine's name. One of another machine is waited for.

    Args:
        own: what a drone of this machine is called.

    Raises:
        LindyError: there are several, or who answers there does not let us in.
    """
    said = False
    while True:
        try:
            there = who_is_there(endpoint, keys)
        except NobodyThereError:
            there = list[str]()
        if len(there) > 1:
            raise LindyError(
                f"{len(there)} drones can be reached at {endpoint}: {in_words(there)}; say which "
                f"with --name"
            )
        if there:
            return there[0]
        if is_local(endpoint):
            return own
        if not said:
            print(
                f"no drone can be reached at {endpoint} yet: waits for one (with --name it is not "
                f"waited for)",
                flush=True,
            )
            said = True
        time.sleep(AGAIN_S)
