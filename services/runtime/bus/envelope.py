"""What a node needs of a bus: subscribe, publish, and forward an envelope without decoding it."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Protocol

from messages.message import Message
from messages.topic import AnyTopic


@dataclass(slots=True)
class Envelope:
    """A message as received. All receivers of a process have the same one, and nobody changes it,
    but for the first that decodes it."""

    key: str
    payload: bytes
    encoding: str
    attachment: bytes | None = None
    message: Message | None = field(default=None, compare=False, repr=False)  # once decoded


Store = Callable[[Envelope], None]  # receives each envelope of a subscription
Say = Callable[[bytes], None]  # publishes an encoded message


class Bus(Protocol):
    """The bus of one side. Nobody receives their own messages."""

    def hear(self, key_expression: str, store: Store) -> None:
        """Subscribe: pass every envelope on these keys to `store`, perhaps on another thread."""
        ...

    def say(self, topic: AnyTopic) -> Say:
        """Publisher: a function that publishes an encoded message on this topic, never blocking."""
        ...

    def forward(self, envelope: Envelope) -> None:
        """Publish an envelope of the other side's bus on this one, byte for byte."""
        ...
