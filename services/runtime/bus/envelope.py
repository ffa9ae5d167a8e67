"""What a node needs of a bus: hear keys, say topics, pass an envelope on unopened."""

from collections.abc import Callable
from typing import NamedTuple, Protocol

from messages.topic import AnyTopic


class Envelope(NamedTuple):
    """A message as it came off the wire, not yet opened."""

    key: str
    payload: bytes
    encoding: str
    attachment: bytes | None = None
    travelled: object = None  # priority and the like, understood only by the bus that made it


Store = Callable[[Envelope], None]
Say = Callable[[bytes], None]


class Bus(Protocol):
    """One realm. Nobody hears what they said themselves."""

    def hear(self, key_expression: str, store: Store) -> None:
        """Hand every envelope on these keys to `store`, perhaps on another thread."""
        ...

    def say(self, topic: AnyTopic) -> Say:
        """A function that puts an encoded message on this topic and never blocks."""
        ...

    def forward(self, envelope: Envelope) -> None:
        """Put an envelope of another realm on this one, byte for byte."""
        ...
