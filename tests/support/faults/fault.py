"""What a fault is: how it begins and ends, and which goals apply to it."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

from messages.link import LinkRequest
from messages.simulator import FaultKind
from tests.support.faults.virtual_dive import VirtualDive

HANGS = "process hangs"  # a cause
HANGS_S = 3.0  # [s]


class AnyDive(Protocol):
    """What can be done to a dive, on virtual time and in real processes alike."""

    def kill(self, name: str) -> None: ...
    def stop(self, name: str) -> None: ...
    def go_on(self, name: str) -> None: ...
    def part(self, part: str, fault: FaultKind, value: float | None = None) -> None: ...
    def link(self, request: LinkRequest) -> None: ...
    def ask(self, **wish: object) -> None: ...


def nothing(_: object) -> None:
    """It ends by itself."""


@dataclass(frozen=True)
class Deeds:
    """How a fault begins and ends, on virtual time and in real processes alike."""

    begin: Callable[[AnyDive], None]
    end: Callable[[AnyDive], None] = nothing


@dataclass(frozen=True)
class VirtualDeeds:
    """… on virtual time alone."""

    begin: Callable[[VirtualDive], None]
    end: Callable[[VirtualDive], None] = nothing


@dataclass(frozen=True, kw_only=True)
class FaultCase:
    """One fault. Times in seconds."""

    name: str
    cause: str  # the group it belongs to
    lasts: float  # [s] from its beginning to its end
    after: float = 3.0  # [s] looked at after its end
    both: Deeds | None = None
    only_virtual: VirtualDeeds | None = None
    only_real: Deeds | None = None
    ask_at: float = 0.3  # [s] after its beginning, when the disarm is asked for
    # Which goals apply besides those for every cell.
    lives: bool = True  # the sensors do: a held depth is held
    no_pilot: bool = False  # the drone hears nobody for longer than 0.3 s
    no_control: bool = False  # nobody commands the thrusters for longer than 0.2 s
    back: float | None = None  # [s] after its beginning the pilot is in control again

    @property
    def flown(self) -> float:
        """[s] How long it is looked at before its end. The supervisor ends what hangs for longer
        than a second, and gives a slow disk ten: the rest of twenty seconds shows nothing more."""
        return min(self.lasts, HANGS_S) if self.cause == HANGS else self.lasts

    @property
    def virtual(self) -> VirtualDeeds | None:
        """On virtual time; None: it cannot be shown there."""
        if self.both is None:
            return self.only_virtual
        return VirtualDeeds(self.both.begin, self.both.end)

    @property
    def real(self) -> Deeds | None:
        """In real processes; None: it would harm the computer, or needs what is not there."""
        return self.both or self.only_real
