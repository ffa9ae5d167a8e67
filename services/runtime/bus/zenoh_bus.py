"""The bus of one side over Zenoh: a star with one hub; every service is a client of that hub, with
explicit endpoints, and has one thread of Zenoh's instead of up to nine.

By itself Zenoh starts five pools of threads, and every message passes through three of them. With
some hundred small messages a second, the switches between the threads cost more than the messages.
With one thread, that thread also empties the queues of what is to be sent; so they must hold what
is published in one go: 16 batches of 64 kB, the most that Zenoh allows, so 1 MB per priority. What
is published beyond that before the thread is free again is dropped: also a small message right
behind 1 MB. Messages of 300 kB leave room for others.
"""

import ctypes
import json
import os
import socket
import stat
import struct
import threading
import time
from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import partial
from typing import Any, Literal

import zenoh
from zenoh import CongestionControl, Priority

from messages import topics
from messages.payload import LONGEST
from messages.topic import AnyTopic, Qos
from services.runtime.bus.access_control import HubSide, KeyFiles, access_control, tls_settings
from services.runtime.bus.envelope import Envelope, Say, Store
from services.runtime.bus.spaces import namespace
from services.runtime.config.disk import reason
from services.runtime.config.errors import LindyError
from services.runtime.os import system

SessionMode = Literal["router", "client"]
UNIX = "unixsock-stream/"  # before the path of a socket, in an endpoint
DESCRIPTORS = "/proc/self/fd"
HUB_PATIENCE_S = 10.0  # [s] a client waits for its hub to start
QUERY_S = 1.0  # [s] for the answer to who is there; a router answers at once
VARIABLE = "ZENOH_RUNTIME"  # Zenoh reads it when the first session of a process is opened
ONE_THREAD = (
    "(rx: (worker_threads: 1), tx: (handover: rx), acc: (handover: rx), "
    "net: (handover: rx), app: (handover: rx))"
)
PUT = zenoh.SampleKind.PUT
BATCHES = 16  # of each priority, on each link
PRIORITIES = (
    "control", "real_time", "interactive_high", "interactive_low", "data_high", "data", "data_low",
    "background",
)  # fmt: skip
QUEUES = dict.fromkeys(PRIORITIES, BATCHES)  # Zenoh's `transport/link/tx/queue/size`
MOST_SESSIONS = 128  # at a hub of a drone or topside: its own services, and other machines


_kept = threading.local()


def use_one_thread() -> None:
    """Call before the first session is opened. What the user's environment says wins."""
    if not os.environ.get(VARIABLE):
        os.environ[VARIABLE] = ONE_THREAD


def keep_thread_state() -> None:
    """Keep Python's state of this thread of Zenoh's for as long as the thread lives; otherwise each
    call of a subscriber makes one, with a stack of its own, and throws it away."""
    if not hasattr(_kept, "state"):
        _kept.state = ctypes.pythonapi.PyGILState_Ensure()  # never released


def config(
    mode: SessionMode,
    listen: Sequence[str] = (),
    connect: Sequence[str] = (),
    space: str | None = None,
    keys: KeyFiles | None = None,
) -> zenoh.Config:
    settings = zenoh.Config()
    listen, connect, passwords = system.local_channel(listen, connect)
    for key, value in (common_settings(mode, listen, connect) | passwords).items():
        settings.insert_json5(key, json.dumps(value))
    if space is not None:
        settings.insert_json5("namespace", json.dumps(space))
    if keys is not None:
        settings.insert_json5("transport/link/tls", json.dumps(tls_settings(keys)))
    return settings


def common_settings(
    mode: SessionMode, listen: Sequence[str], connect: Sequence[str]
) -> dict[str, Any]:
    """Explicit endpoints, no discovery, so that many stacks run side by side on one machine. By
    their place in Zenoh's configuration."""
    return {
        "mode": mode,
        "scouting/multicast/enabled": False,
        "scouting/gossip/enabled": False,
        "listen/endpoints": list(listen),
        "connect/endpoints": list(connect),
        "transport/shared_memory/enabled": False,  # it would bypass a shaped link
        "transport/link/rx/max_message_size": 4
        * LONGEST,  # what is longer closes its sender's link
        "transport/link/tx/lease": 1000,  # [ms] a disconnected cable is noticed after this
        "transport/link/tx/queue/size": QUEUES,
        "connect/retry": {"period_init_ms": 50, "period_max_ms": 200, "period_increase_factor": 2},
    }


def listening(
    *endpoints: str, connect: Sequence[str] = (), hub_side: HubSide | None = None
) -> zenoh.Session:
    """A hub's session.

    Args:
        connect: endpoints of other machines' hubs; retried while they cannot be reached.
        hub_side: side of this hub, for access control; None: there is no other machine.

    Raises:
        LindyError: the endpoint is taken or malformed.
    """
    endpoint = endpoints[-1]
    try:
        credentials = None if hub_side is None else hub_side.credentials
        settings = config(
            "router", endpoints, connect, keys=None if credentials is None else credentials.keys
        )
        if hub_side is not None:
            settings.insert_json5("access_control", json.dumps(access_control(hub_side)))
            settings.insert_json5("transport/unicast/max_sessions", json.dumps(MOST_SESSIONS))
        return _open(settings)
    except OSError as error:
        raise LindyError(f"cannot listen on {endpoint}: {reason(error)}") from None
    except zenoh.ZError as error:
        taken = "in use" in str(error)
        said = str(error).split(" at /")[0]  # what follows is Zenoh's own source line
        said = said.removeprefix('Json5Err(Message { msg: "')
        why = "is already in use" if taken else f"cannot be listened on ({said})"
        free = 7457 if endpoint.endswith(":7447") else 7447
        raise LindyError(
            f"endpoint {endpoint} {why}; choose another, for example tcp/127.0.0.1:{free}"
        ) from None


def connected(
    endpoint: str,
    space: str | None,
    patience_s: float = HUB_PATIENCE_S,
    *,
    keys: KeyFiles | None = None,
) -> zenoh.Session:
    """A client's session; waits for the hub, because a client's `open` raises without one.

    Args:
        space: its keys are relative to this namespace; None: to none, to see several drones.
        keys: for a hub that is reached by TLS.

    Raises:
        LindyError: no hub answered within `patience_s`.
    """
    deadline = time.monotonic() + patience_s
    while True:
        try:
            return _open(config("client", connect=[endpoint], space=space, keys=keys))
        except zenoh.ZError:
            if time.monotonic() > deadline:
                raise LindyError(f"no hub answers at {endpoint} after {patience_s:g} s") from None
            time.sleep(0.05)  # between two attempts; nothing announces that the hub has started


def _open(settings: zenoh.Config) -> zenoh.Session:
    use_one_thread()
    try:
        return zenoh.open(settings)
    except BaseException as error:
        if type(error).__name__ != "PanicException":  # Zenoh gives it no other name
            raise
        if (chosen := os.environ[VARIABLE]) == ONE_THREAD:
            why = "this computer has no room for another thread, or no memory"
            raise LindyError(f"Zenoh does not start: {why}") from None
        reason = f"{VARIABLE} is {chosen!r}, and Zenoh does not start with it"
        raise LindyError(f"{reason}; without it, one thread is used") from None


def announce_here(session: zenoh.Session, key: str) -> object:
    """Hold a liveliness token as long as what is returned is kept, and the session lives."""
    return session.liveliness().declare_token(key)


def watch_callers(session: zenoh.Session, changed: Callable[[str, bool], None]) -> object:
    """Call `changed(common name, connected)` for everybody who comes with a certificate, present
    and future, as long as what is returned is kept."""

    def on_link(link: zenoh.Link, there: bool) -> None:
        if (name := link.auth_identifier) is not None:
            changed(name, there)

    return _watch_links(session, on_link)


def close_without_waiting(session: zenoh.Session) -> object:
    """Let every link over TCP end at once, present and future, as long as what is returned is kept.
    Zenoh has Linux wait up to ten seconds for what the other end has not acknowledged, and a hub
    whose one thread waits so serves nobody meanwhile. Zenoh cannot be told otherwise, its
    descriptors can: SO_LINGER off."""

    def on_link(link: zenoh.Link, there: bool) -> None:
        if not there or not link.src.startswith(("tcp/", "tls/")):
            return
        wanted = [end.partition("/")[2] for end in (link.src, link.dst)]
        for number in _sockets():
            with suppress(OSError), socket.socket(fileno=os.dup(number)) as found:
                if _ends(found) == wanted:
                    found.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 0, 0))

    return _watch_links(session, on_link)


def _sockets() -> Iterator[int]:
    """Descriptor of every socket of this process."""
    try:
        numbers = os.listdir(DESCRIPTORS)  # noqa: PTH208 - names alone
    except OSError:  # not Linux, or no descriptors are left
        return
    for number in map(int, numbers):
        with suppress(OSError):  # it was closed meanwhile
            if stat.S_ISSOCK(os.fstat(number).st_mode):
                yield number


def _ends(link: socket.socket) -> list[str]:
    """Of a connection over TCP: `host:port` of this end and of the other, as Zenoh writes them."""
    if link.family not in (socket.AF_INET, socket.AF_INET6) or link.type != socket.SOCK_STREAM:
        return []
    try:
        both = link.getsockname(), link.getpeername()
    except OSError:  # it listens, or has ended
        return []
    return [f"[{host}]:{port}" if ":" in host else f"{host}:{port}" for host, port, *_ in both]


def _watch_links(session: zenoh.Session, changed: Callable[[zenoh.Link, bool], None]) -> object:
    def on_link(event: zenoh.LinkEvent) -> None:
        changed(event.link, event.kind == zenoh.SampleKind.PUT)

    handler = zenoh.handlers.Callback(on_link, indirect=False)
    return session.info.declare_link_events_listener(handler, history=True)


class ZenohBus:
    """One node's connection to the bus of one side."""

    def __init__(self, session: zenoh.Session) -> None:
        self._session = session
        self._keep: list[object] = []  # undeclared when collected, so hold on to them
        self._forwards: dict[str, Callable[..., None]] = {}  # by key

    def hear(self, key_expression: str, store: Store) -> None:
        # `indirect=False`: store on Zenoh's own thread; it only appends and wakes. A queue with
        # a thread behind it fills up, and one full queue blocks reception for the whole session.
        def on_sample(sample: zenoh.Sample) -> None:
            if not hasattr(_kept, "state"):
                keep_thread_state()
            if sample.kind == PUT:
                attachment = sample.attachment
                store(
                    Envelope(
                        str(sample.key_expr),
                        sample.payload.to_bytes(),
                        str(sample.encoding),
                        None if attachment is None else attachment.to_bytes(),
                    )
                )

        handler = zenoh.handlers.Callback(on_sample, indirect=False)
        self._keep.append(
            self._session.declare_subscriber(
                key_expression, handler, allowed_origin=zenoh.Locality.REMOTE
            )
        )

    def say(self, topic: AnyTopic) -> Say:
        put: Say = self._publisher(topic).put
        return put

    def _publisher(self, topic: AnyTopic) -> Any:  # its stub does not say of what
        qos = QOS_PROFILES[topic.qos]
        return self._session.declare_publisher(
            topic.key,
            encoding=topic.encoding,
            priority=qos.priority,
            congestion_control=qos.congestion_control,
            express=qos.express,
        )

    def forward(self, envelope: Envelope) -> None:
        put = self._forwards.get(envelope.key) or self._forward(envelope.key)
        put(envelope.payload, encoding=envelope.encoding, attachment=envelope.attachment)

    def _forward(self, key: str) -> Callable[..., None]:
        """What publishes an envelope with its topic's QoS, whatever its sender wanted: this thread
        also empties the queue, so it must not wait."""
        topic = topics.find(key)
        if topic is not None and not topic.is_family:
            put: Callable[..., None] = self._publisher(topic).put
            self._forwards[key] = put
            return put
        # Anybody can invent members of a family, also such as it does not cover: none is kept.
        qos = QOS_PROFILES[Qos.BULK if topic is None else topic.qos]
        session: Any = self._session  # its stub does not say what `put` returns
        return partial(
            session.put,
            key,
            priority=qos.priority,
            congestion_control=qos.congestion_control,
            express=qos.express,
        )

    def announce(self, service: str) -> None:
        """Declare a liveliness token; when it disappears, everyone knows within milliseconds."""
        self._keep.append(self._session.liveliness().declare_token(f"alive/{service}"))

    def watch(self, changed: Callable[[str, bool], None], key: str = "alive/*") -> None:
        """Call `changed(key of a token, is it there)` for every liveliness token, present and
        future."""

        def on_token(sample: zenoh.Sample) -> None:
            keep_thread_state()
            changed(str(sample.key_expr), sample.kind == zenoh.SampleKind.PUT)

        handler = zenoh.handlers.Callback(on_token, indirect=False)
        liveliness = self._session.liveliness()
        self._keep.append(liveliness.declare_subscriber(key, handler, history=True))

    def tokens(self, key: str) -> list[str]:
        """Keys of the liveliness tokens that are there now, also strangers'."""
        replies = self._session.liveliness().get(key, timeout=QUERY_S)
        return [str(reply.ok.key_expr) for reply in replies if reply.ok is not None]


@contextmanager
def open_bus(endpoint: str, name: str, keys: KeyFiles | None = None) -> Generator[ZenohBus]:
    """A client's bus. Always closed: a session left open hangs the process at exit."""
    with connected(endpoint, namespace(name), keys=keys) as session:
        yield ZenohBus(session)


@dataclass(frozen=True, slots=True)
class ZenohQos:
    """Zenoh's QoS of a topic."""

    priority: Priority
    congestion_control: CongestionControl
    express: bool


# Nothing blocks: a `put` that waits for a slow reader would stall a control loop for seconds, so
# even events are DROP, and their senders repeat until answered. Batching stays on (express off),
# because express with DROP loses messages under CPU load.
QOS_PROFILES = {
    Qos.REALTIME: ZenohQos(Priority.REAL_TIME, CongestionControl.DROP, express=False),
    Qos.LIVE: ZenohQos(Priority.INTERACTIVE_HIGH, CongestionControl.DROP, express=False),
    Qos.EVENT: ZenohQos(Priority.DATA_HIGH, CongestionControl.DROP, express=False),
    Qos.BULK: ZenohQos(Priority.BACKGROUND, CongestionControl.DROP, express=False),
}


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
