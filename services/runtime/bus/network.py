"""The whole network from outside of any drone's namespace: who is there, and rows of all drones.

It says nothing there, so nobody's dive changes by it.
"""

import socket
from collections.abc import Callable, Generator
from contextlib import contextmanager

import zenoh

from messages.topic import AnyTopic
from services.runtime.bus.key_files import KeyFiles
from services.runtime.bus.spaces import EVERY_SPACE, here_key, namespace
from services.runtime.bus.zenoh_bus import connected
from services.runtime.bus.zenoh_threads import keep_thread_state
from services.runtime.config.errors import LindyError

ANSWER_S = 0.5  # [s] in which a port opens, if anybody listens there
QUERY_S = 1.0  # [s] for the answer to who is there; a router answers at once


class NobodyThereError(LindyError):
    """Nothing listens at an endpoint: what is to be there may not have been started yet."""


Hears = Callable[[str, bytes], None]  # a key and a payload, on Zenoh's thread


class Network:
    """Made by `open_network`."""

    def __init__(self, session: zenoh.Session) -> None:
        self._session = session
        self._keep: list[object] = []  # undeclared when collected, so hold on to them

    @property
    def answers(self) -> bool:
        """Is who was reached still there?"""
        return bool(self._session.info.routers_zid())

    def tokens(self, name: str = "*", side: str = "drone") -> list[str]:
        """Keys of the liveliness tokens of hubs that are there now, also strangers'."""
        wanted = here_key(namespace(name), side)
        replies = self._session.liveliness().get(wanted, timeout=QUERY_S)
        return [str(reply.ok.key_expr) for reply in replies if reply.ok is not None]

    def watch(self, changed: Callable[[str, bool], None]) -> None:
        """Call `changed(key of a token, is it there)` for every drone's hub, present and future."""

        def on_token(sample: zenoh.Sample) -> None:
            keep_thread_state()
            changed(str(sample.key_expr), sample.kind == zenoh.SampleKind.PUT)

        handler = zenoh.handlers.Callback(on_token, indirect=False)
        self._keep.append(
            self._session.liveliness().declare_subscriber(
                here_key(EVERY_SPACE, "drone"), handler, history=True
            )
        )

    def hear(self, topic: AnyTopic, heard: Hears) -> None:
        """A row of every drone."""

        def on_sample(sample: zenoh.Sample) -> None:
            keep_thread_state()
            if sample.kind == zenoh.SampleKind.PUT:
                heard(str(sample.key_expr), sample.payload.to_bytes())

        handler = zenoh.handlers.Callback(on_sample, indirect=False)
        self._keep.append(self._session.declare_subscriber(f"{EVERY_SPACE}/{topic.key}", handler))


@contextmanager
def open_network(
    endpoint: str, patience_s: float, *, keys: KeyFiles | None = None
) -> Generator[Network]:
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
        yield Network(session)


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
