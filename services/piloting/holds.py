"""Keys and buttons that have to be held: what arms or disarms is deliberate. Pure."""

from collections.abc import Set

from messages.units import Ns
from services.piloting.keys import HOLD_NS
from services.piloting.pilot_intents import Held, Press


class Holds:
    def __init__(self) -> None:
        self._since: dict[Press, Ns | None] = {}  # None: done, or not to be counted

    def read(self, down: Set[Press], counted: Set[Press], now: Ns) -> tuple[Held, ...]:
        """Requests whose hold is complete now; each once, until it was let go.

        Args:
            down: what is held now.
            counted: of it, what may begin to count. The rest does nothing until it was let go.
        """
        self._since = {p: s for p, s in self._since.items() if p in down}
        for press in down - self._since.keys():
            self._since[press] = now if press in counted else None
        done = tuple(
            Held(press, since)
            for press, since in self._since.items()
            if since is not None and now >= since + HOLD_NS
        )
        self._since |= {held.press: None for held in done}
        return done
