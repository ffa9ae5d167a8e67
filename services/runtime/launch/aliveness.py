"""Which services of this machine are alive, by the tokens that each shows on each of its sides.
Pure."""

from collections.abc import Collection

from services.runtime.hosts.registry import Registry


class Aliveness:
    """Of the services of this machine."""

    def __init__(self, services: Registry, sides: Collection[str]) -> None:
        """
        Args:
            sides: those with a hub on this machine.
        """
        self._services, self._sides = services, sides
        self._processes = services.processes
        self.shown: set[tuple[str, str]] = set()  # (side, service)
        self.seen: set[tuple[str, str]] = set()  # the same, ever

    def token(self, side: str, service: str, *, shown: bool) -> str | None:
        """A token was shown, or is gone. Returns the process that is whole with it."""
        if not shown:
            self.shown.discard((side, service))
            return None
        self.shown.add((side, service))
        self.seen.add((side, service))
        spec, missing = self._services.get(service), self.missing()
        process = service if spec is None else spec.process or service
        whole = not any(name in missing for name in self._processes.get(process, ()))
        return process if whole else None

    def missing(self) -> list[str]:
        """Services that are not alive on all of their sides."""
        return self._not_in(self.shown)

    def never_alive(self) -> list[str]:
        """Services that were not even once."""
        return self._not_in(self.seen)

    def _not_in(self, tokens: set[tuple[str, str]]) -> list[str]:
        return [
            name
            for name, spec in self._services.items()
            if any((s, name) not in tokens for s in spec.sides if s in self._sides)
        ]
