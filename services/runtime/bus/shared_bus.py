"""The bus of one side for several nodes of one process, over one connection.

What they publish is handed to each other inside, and published once for everybody else. As on any
bus, nobody receives their own messages, and everybody else receives each message once.
"""

from messages.topic import AnyTopic
from services.runtime.bus.envelope import Bus, Envelope, Say, Store
from services.runtime.bus.memory_bus import MemoryBus


class SharedBus:
    """One connection, and a `SharedBusPort` on it for each node."""

    def __init__(self, outside: Bus) -> None:
        """The connection must not pass on what was published through it, as a `ZenohBus`."""
        self.outside = outside
        self.inside = MemoryBus()
        self._stores: dict[str, list[Store]] = {}  # by key expression

    def hear_outside(self, key_expression: str, store: Store) -> None:
        """Subscribe to what others publish. All nodes with the same key expression share one
        subscription, so each message is received and copied once for all of them."""
        if (known := self._stores.get(key_expression)) is not None:
            known.append(store)
            return
        stores = self._stores[key_expression] = [store]

        def arrived(envelope: Envelope) -> None:
            for each in stores:
                each(envelope)

        self.outside.hear(key_expression, arrived)


class SharedBusPort:
    """One node's end of a `SharedBus`."""

    def __init__(self, bus: SharedBus) -> None:
        self._bus = bus

    def hear(self, key_expression: str, store: Store) -> None:
        self._bus.inside.listen(key_expression, store, self)
        self._bus.hear_outside(key_expression, store)

    def say(self, topic: AnyTopic) -> Say:
        key, encoding = topic.key, topic.encoding
        inside, publish = self._bus.inside, self._bus.outside.say(topic)

        def put(payload: bytes) -> None:
            inside.deliver(Envelope(key, payload, encoding), self)
            publish(payload)

        return put

    def forward(self, envelope: Envelope) -> None:
        self._bus.inside.deliver(envelope, self)
        self._bus.outside.forward(envelope)
