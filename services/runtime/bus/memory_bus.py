"""A bus inside one process, for the virtual host. Messages cross it encoded, like on the wire."""

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
    """One realm shared by all its listeners; each node gets its own `MemoryBusPort` on it."""

    def __init__(self) -> None:
        self._listeners: list[tuple[str, Store, object]] = []
        self._routes: dict[str, list[tuple[Store, object]]] = {}

    def listen(self, key_expression: str, store: Store, who: object) -> None:
        self._listeners.append((key_expression, store, who))
        self._routes.clear()

    def leave(self, who: object) -> None:
        """Forget a listener, as when its process ends."""
        self._listeners = [entry for entry in self._listeners if entry[2] is not who]
        self._routes.clear()

    def deliver(self, envelope: Envelope, sender: object) -> None:
        route = self._routes.get(envelope.key)
        if route is None:
            route = [(store, who) for k, store, who in self._listeners if matches(k, envelope.key)]
            self._routes[envelope.key] = route
        for store, who in route:
            if who is not sender:
                store(envelope)


class MemoryBusPort:
    """One node's end of a `MemoryBus`."""

    def __init__(self, bus: MemoryBus) -> None:
        self._bus = bus

    def hear(self, key_expression: str, store: Store) -> None:
        self._bus.listen(key_expression, store, self)

    def say(self, topic: AnyTopic) -> Say:
        key, encoding = topic.key, topic.encoding

        def put(payload: bytes) -> None:
            self._bus.deliver(Envelope(key, payload, encoding), self)

        return put

    def forward(self, envelope: Envelope) -> None:
        self._bus.deliver(envelope, self)

    def close(self) -> None:
        self._bus.leave(self)
