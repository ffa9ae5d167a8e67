"""The whole network from outside of any drone's namespace. Nothing is said there, so nobody's dive
changes by it."""

import socket
from collections.abc import Generator
from contextlib import contextmanager

from services.runtime.bus.key_files import KeyFiles
from services.runtime.bus.zenoh_bus import ZenohBus, connected
from services.runtime.config.errors import LindyError

ANSWER_S = 0.5  # [s] in which a port opens, if anybody listens there


class NobodyThereError(LindyError):
    """Nothing listens at an endpoint: what is to be there may not have been started yet."""


@contextmanager
def open_network(
    endpoint: str, patience_s: float, *, keys: KeyFiles | None = None
) -> Generator[ZenohBus]:
    """
    Raises:
        NobodyThereError: nothing listens there.
        LindyError: who listens there does not let us in.
    """
    try:
        session = connected(endpoint, None, patience_s, keys=keys)
    except LindyError as error:
        if not _listens(endpoint):
            raise NobodyThereError(str(error)) from None
        about_keys = "asks for keys" if keys is None else "does not know these keys"
        raise LindyError(
            f"what answers at {endpoint} is no Zenoh router of this version, or {about_keys}"
        ) from None
    with session:
        yield ZenohBus(session)


def _listens(endpoint: str) -> bool:
    """Does anything at all listen there?"""
    protocol, _, address = endpoint.partition("/")
    host, _, port = address.partition("?")[0].partition("#")[0].rpartition(":")
    if protocol not in ("tcp", "tls") or not port.isdecimal():
        return False
    try:
        with socket.create_connection((host.strip("[]"), int(port)), ANSWER_S):
            return True
    except OSError:
        return False
