"""A bus inside one process, for the virtual host. Messages are encoded, as on a network."""

from messages.topic import AnyTopic
from services.runtime.bus.envelope import Envelope, Say, Store


def matches(key_expression: str, key: str) -> bool:
    """Zenoh key matching for the two wildcards Lindy uses: a trailing `*` chunk, and `**`."""
    if key_expression == "**":
        return True
    if key_expression.endswith("/*"):
        prefix = key_expression[:-1]
        return key.startswith(prefix) and "/" not in key[len(prefix) :]
    return key == key_expression


class MemoryBus:
    """The bus of one side; each node gets its own `MemoryBusPort` on it."""

    def __init__(self) -> None:
        self._listeners: list[tuple[str, Store, object]] = []  # (key expression, store, port)
        self._routes: dict[str, list[tuple[Store, object]]] = {}

    def listen(self, key_expression: str, store: Store, port: object) -> None:
        self._listeners.append((key_expression, store, port))
        self._routes.clear()

    def leave(self, port: object) -> None:
        """Remove a port's subscriptions, as when its process ends."""
        self._listeners = [entry for entry in self._listeners if entry[2] is not port]
        self._routes.clear()

    def deliver(self, envelope: Envelope, sender: object) -> None:
        route = self._routes.get(envelope.key)
        if route is None:
            route = [
                (store, port) for k, store, port in self._listeners if matches(k, envelope.key)
            ]
            self._routes[envelope.key] = route
        for store, port in route:
            if port is not sender:
                store(envelope)


class MemoryBusPort:
    """One node's end of a `MemoryBus`."""

    def __init__(self, bus: MemoryBus) -> None:
        self._bus = bus

    def hear(self, key_expression: str, store: Store) -> None:
        self._bus.listen(key_expression, store, self)

    def say(self, topic: AnyTopic) -> Say:
        key, encoding, deliver = topic.key, topic.encoding, self._bus.deliver

        def put(payload: bytes) -> None:
            deliver(Envelope(key, payload, encoding), self)

        return put

    def forward(self, envelope: Envelope) -> None:
        self._bus.deliver(envelope, self)

    def close(self) -> None:
        self._bus.leave(self)
