"""A session in a Zenoh network that is not Lindy's, such as that of ROS 2: other keys, other
programs, a router of theirs. Nothing of Lindy's own buses goes there by itself.

Whoever publishes never waits: while the router cannot be reached nobody hears anything, and what
was declared is there again once it can be.
"""

import json
import secrets
import threading
from collections.abc import Callable
from typing import Any, NamedTuple

import zenoh
from zenoh.ext import (
    AdvancedPublisher,
    CacheConfig,
    MissDetectionConfig,
    declare_advanced_publisher,
)

from services.runtime.bus.spaces import checked_endpoint
from services.runtime.bus.zenoh_bus import common_settings, keep_thread_state, use_one_thread

HEARTBEAT_S = 5.0  # [s] of what is kept, at most, and only after something was said
AGAIN_S = 1.0  # [s] between two attempts to reach a router that has not been there yet
LONGEST = 65_536  # [B] of a message that is taken
Takes = Callable[[str, bytes, bytes], None]  # key, payload and attachment, on Zenoh's thread


class OtherPublisher:
    """Publishes on one key while somebody listens there."""

    def __init__(self) -> None:
        self._publisher: zenoh.Publisher | None = None
        self._listener: object = None
        self.heard = False  # does anybody subscribe to it?

    def put(self, payload: bytes, attachment: bytes) -> None:
        if self._publisher is not None:
            self._publisher.put(payload, attachment=attachment)

    def declare(self, session: zenoh.Session, key: str) -> None:
        def changed(status: zenoh.MatchingStatus) -> None:
            keep_thread_state()
            self.heard = status.matching

        drop = zenoh.CongestionControl.DROP
        self._publisher = session.declare_publisher(key, congestion_control=drop)
        handler = zenoh.handlers.Callback(changed, indirect=False)
        self._listener = self._publisher.declare_matching_listener(handler)
        now: Any = self._publisher.matching_status  # which is no bool, as its stub has it
        self.heard = bool(now.matching)


class Kept(NamedTuple):
    """What whoever subscribes later is to hear, too."""

    key: str
    payload: bytes
    attachment: bytes

    def declare(self, session: zenoh.Session) -> AdvancedPublisher:
        publisher = declare_advanced_publisher(
            session,
            self.key,
            cache=CacheConfig(1),
            publisher_detection=True,
            sample_miss_detection=MissDetectionConfig(
                heartbeat=None, sporadic_heartbeat=HEARTBEAT_S
            ),
        )
        publisher.put(self.payload, attachment=self.attachment)
        return publisher


class OtherNetwork:
    """A client of that network's router."""

    def __init__(self, router: str, option: str) -> None:
        """
        Args:
            router: its endpoint, as Zenoh writes it.
            option: the setting that names it, for an error message.

        Raises:
            LindyError: this is no endpoint.
        """
        self._router = checked_endpoint(router, option)
        self.session_id = f"{secrets.randbits(127) | 1 << 127:x}"  # as Zenoh writes it
        self.too_long = 0  # messages that were not taken
        self._session: zenoh.Session | None = None
        self._declares: list[Callable[[zenoh.Session], object]] = []
        self._keep: list[object] = []  # undeclared when collected, so hold on to them
        self._ends = threading.Event()
        self._thread = threading.Thread(target=self._join, daemon=True)

    def publisher(self, key: str) -> OtherPublisher:
        publisher = OtherPublisher()
        self._declares.append(lambda session: publisher.declare(session, key))
        return publisher

    def keep(self, key: str, payload: bytes, attachment: bytes) -> None:
        """Say this once, and again to whoever subscribes later."""
        self._declares.append(Kept(key, payload, attachment).declare)

    def hear(self, key: str, takes: Takes) -> None:
        def on_sample(sample: zenoh.Sample) -> None:
            keep_thread_state()
            if sample.kind != zenoh.SampleKind.PUT:
                return
            if len(sample.payload) > LONGEST:
                self.too_long += 1
                return
            attachment = sample.attachment
            given = b"" if attachment is None else attachment.to_bytes()
            takes(str(sample.key_expr), sample.payload.to_bytes(), given)

        handler = zenoh.handlers.Callback(on_sample, indirect=False)
        self._declares.append(lambda session: session.declare_subscriber(key, handler))

    def announce(self, token: str) -> None:
        """Hold a liveliness token."""
        self._declares.append(lambda session: session.liveliness().declare_token(token))

    def start(self) -> None:
        """Everything was declared: it is there as soon as the router answers."""
        self._thread.start()

    @property
    def connected(self) -> bool:
        session = self._session
        return session is not None and bool(session.info.routers_zid())

    def close(self) -> None:
        self._ends.set()
        if self._thread.is_alive():
            self._thread.join()
        if self._session is not None:
            self._session.close()

    def _join(self) -> None:
        """Zenoh itself comes back to a router that has been there once, and not before."""
        use_one_thread()
        while not self._ends.is_set():
            try:
                session = zenoh.open(self._config())
            except zenoh.ZError:
                self._ends.wait(AGAIN_S)
                continue
            self._keep = [declare(session) for declare in self._declares]
            self._session = session
            return

    def _config(self) -> zenoh.Config:
        settings = zenoh.Config()
        for key, value in common_settings("client", (), [self._router]).items():
            settings.insert_json5(key, json.dumps(value))
        settings.insert_json5("id", json.dumps(self.session_id))
        return settings
