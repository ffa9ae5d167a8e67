"""What the conditions that hold make the drone do: one state machine for all rows of the table.

The rules:

1. A condition that begins starts the first stage of its row. Each next stage begins when the
   condition has held for the stage's time without a break. A stage never goes back.
2. Of several conditions the gravest reaction acts (notice, limit, stop, ascend, surface); of equal
   ones the row that comes first in the table. All of them are listed.
3. A notice and a limit end with their condition.
4. Stop, ascend and surface end by a deliberate act of the pilot alone: `resume`, or disarming.
   A condition that has ended goes on acting, in the stage it has reached, until then. After a
   short loss, centred sticks are act enough: where a row is `brief`, still in its first stage,
   never held for `SHORT_NS` without a break, and the pilot is the one who was there when it began.
5. `resume` is refused while a condition that acts still holds, unless its row may be overruled. An
   overruled condition does not act again until it has ended or become worse.
6. While the drone is disarmed nothing acts: the stages begin anew when it is armed.
7. An ascent that has reached the surface stays there: it has become `surface`.
8. What is not known yet, as the leak after a restart, has not ended.

Pure: state × (conditions that hold, now).
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import msgspec
from msgspec.structs import replace

from messages.events import RESUMED_SHORT_LOSS, RETURN, UNMOVED, Outbox, short
from messages.units import Ns
from messages.vehicle import Reaction, Returns
from services.reference.failsafe.table import ACTING, SEVERITY, SHORT_NS, FailsafeRow

DOES: dict[Reaction, str] = {
    "stop": "the drone has stopped and holds",
    "ascend": "the drone rises slowly",
    "surface": "the drone stays at the surface",
}
CANNOT_MOVE = "nothing moves the drone: its board or control does not answer"


class Holding(NamedTuple):
    """A condition that holds now."""

    level: int = 0  # [-] how bad; a greater one is worse
    detail: str = ""  # which sensor, thruster, service …


Conditions = Mapping[str, Holding]  # by the names of the table


class Memory(msgspec.Struct, frozen=True):
    """Of one condition. Checkpoint: a restart ends no failsafe."""

    since_ns: int  # [ns] when it began, without a break since
    holds: bool = True
    stage: int = 0  # of the row
    overruled: int | None = None  # level at which the pilot has overruled it
    pilot: tuple[int, int] = (0, 0)  # whom the drone obeyed when it began
    long: bool = False  # it has held for `SHORT_NS`, or the pilot has changed


@dataclass(slots=True)
class FailsafeMachine:
    """Times `now` are int ns, never decreasing. Tells which conditions were noticed, and which have
    begun to act."""

    rows: Sequence[FailsafeRow]
    outbox: Outbox
    memory: Mapping[str, Memory] = field(default_factory=dict[str, Memory])  # replaced, not changed
    armed: bool = False  # at the newest step
    surfaced: bool = False
    _holding: Conditions = field(default_factory=dict[str, Holding])

    def step(
        self,
        holding: Conditions,
        now: Ns,
        *,
        armed: bool,
        at_surface: bool,
        unknown: Collection[str] = (),
        pilot: tuple[int, int] = (0, 0),
    ) -> None:
        """Take in the conditions that hold now.

        Args:
            at_surface: the reference rests at the surface depth, or above it.
            unknown: names of conditions of which nothing is known yet: they go on as they were.
            pilot: authority epochs, the one that acts and the newest: another pilot, others.
        """
        self._holding = holding
        if holding or self.memory:
            after: dict[str, Memory] = {}
            for row in self.rows:
                before = _aged(self.memory.get(row.name), pilot, now)
                if row.name in holding:
                    new = Memory(now, pilot=pilot)
                    after[row.name] = self._held(
                        row, before, new, holding[row.name], now, armed=armed
                    )
                elif before is not None and row.name in unknown:
                    after[row.name] = before
                elif before is not None and armed and _acts(row, before):
                    after[row.name] = replace(before, holds=False) if before.holds else before
            if after != self.memory:
                self.memory = after
        self.armed = armed
        rises = self.reaction in ("ascend", "surface")
        self.surfaced = rises and (self.surfaced or at_surface)

    def _held(
        self,
        row: FailsafeRow,
        before: Memory | None,
        new: Memory,
        held: Holding,
        now: Ns,
        *,
        armed: bool,
    ) -> Memory:
        """Of a condition that holds.

        Args:
            new: the same, where it begins now.
        """
        is_new = before is None
        after = new if before is None else before
        if after.overruled is not None and held.level > after.overruled:
            is_new, after = True, new
        if not after.holds:
            after = replace(after, since_ns=now, holds=True)
        if armed and not self.armed:
            after = replace(after, since_ns=now, stage=0)
        acted = not is_new and self.armed and _acts(row, after)
        while (
            armed
            and after.stage + 1 < len(row.stages)
            and now - after.since_ns >= row.stages[after.stage + 1].after * 1e9
        ):
            after = replace(after, stage=after.stage + 1)
        if armed and _acts(row, after) and not acted:
            does = DOES[row.stages[after.stage].reaction]
            self.outbox.tell(row.condition.acted(detail=does))
        elif is_new and row.told and row.stages[0].reaction not in ACTING:
            self.outbox.tell(row.condition.noticed(detail=held.detail))
        return after

    # What the pilot does.

    def resume(self) -> str:
        """End what acts; where nothing acts, overrule what is about to. Returns why it is refused,
        or nothing."""
        ended = self._acting or [  # what holds and will act, and may be overruled
            row
            for row in self.rows
            if row.acts and row.overrule and self.armed
            if (memory := self.memory.get(row.name)) is not None and memory.overruled is None
        ]
        if not ended:
            return "no failsafe acts: there is nothing to resume from"
        for row in ended:
            if self.memory[row.name].holds and not row.overrule:
                return f"{row.condition.sentence}, still"
        after = dict(self.memory)
        for row in ended:
            memory = after.pop(row.name)
            if memory.holds:
                held = self._holding.get(row.name)
                after[row.name] = replace(memory, overruled=0 if held is None else held.level)
        self.memory, self.surfaced = after, False
        return ""

    def give_back(self) -> None:
        """The sticks were centred for long enough: a short loss that has ended acts no more."""
        if self.returns == "centre" and self.resumable:
            self.resume()
            self.outbox.tell(RESUMED_SHORT_LOSS())

    def disarm(self) -> None:
        """Forget what has ended."""
        self.memory = {name: memory for name, memory in self.memory.items() if memory.holds}
        self.armed = self.surfaced = False

    # What is said.

    @property
    def acting(self) -> FailsafeRow | None:
        """The row that acts: of those with the gravest reaction the first, and before those that
        have ended one that holds."""
        gravest, most = None, (-1, False)
        for row in self._acting:
            reaction = SEVERITY.index(self._reaction(row) or "notice")
            if (reaction, self.memory[row.name].holds) > most:
                gravest, most = row, (reaction, self.memory[row.name].holds)
        return gravest

    @property
    def reaction(self) -> Reaction | None:
        """What the drone does now."""
        row = self.acting
        reaction = None if row is None else self._reaction(row)
        return "surface" if reaction == "ascend" and self.surfaced else reaction

    @property
    def resumable(self) -> bool:
        """Something acts, and none of it holds."""
        acting = self._acting
        return bool(acting) and not any(self.memory[row.name].holds for row in acting)

    @property
    def returns(self) -> Returns | None:
        """What gives the sticks back to the pilot; None: he has them."""
        if not (acting := self._acting):
            return None
        memories = [self.memory[row.name] for row in acting]
        short = all(not memory.long and memory.stage == 0 for memory in memories)
        if short and all(row.brief for row in acting):
            return "centre"
        held = [row for row in acting if self.memory[row.name].holds]
        return "resume" if all(row.overrule for row in held) else "wait"

    @property
    def holding(self) -> tuple[str, ...]:
        """Names of all conditions that hold, in the order of the table."""
        if not self._holding:
            return ()
        return tuple(row.name for row in self.rows if row.name in self._holding)

    @property
    def since_ns(self) -> Ns | None:
        """[ns] When the acting condition began."""
        return None if self.acting is None else self.memory[self.acting.name].since_ns

    @property
    def next_ns(self) -> Ns | None:
        """[ns] When the next stage of a condition that holds begins; None: there is none."""
        if not self.memory or not self.armed:
            return None
        coming = [
            memory.since_ns + round(row.stages[memory.stage + 1].after * 1e9)
            for row in self.rows
            if (memory := self.memory.get(row.name)) is not None
            and memory.holds
            and memory.overruled is None
            and memory.stage + 1 < len(row.stages)
        ]
        return min(coming, default=None)

    @property
    def words(self) -> str:
        """Everything that acts, what the drone does, and what ends it; empty: nothing acts."""
        reaction = self.reaction
        if reaction is None:
            return ""
        acting = self._acting
        held = [row for row in acting if self.memory[row.name].holds]
        ended = [row for row in acting if row not in held]
        causes = [
            *map(self._sentence, held),
            *(f"{short(row.condition.acted.name)} has ended" for row in ended),
        ]
        does = DOES[reaction] if UNMOVED.isdisjoint(self._holding) else CANNOT_MOVE
        return "; ".join([*causes, does, RETURN[self.returns or "wait"]])

    @property
    def notices(self) -> str:
        """Every condition that holds and does not act."""
        said = [row for row in self.rows if row.name in self._holding]
        return "; ".join(self._sentence(row) for row in said if self._reaction(row) not in ACTING)

    @property
    def _acting(self) -> list[FailsafeRow]:
        """Rows that act, in the order of the table."""
        if not self.memory:
            return []
        return [row for row in self.rows if self._reaction(row) in ACTING]

    def _sentence(self, row: FailsafeRow) -> str:
        held, words = self._holding.get(row.name), row.condition.sentence
        return f"{words} ({held.detail})" if held is not None and held.detail else words

    def _reaction(self, row: FailsafeRow) -> Reaction | None:
        memory = self.memory.get(row.name)
        if memory is None:
            return None
        reacts = self.armed and memory.overruled is None
        return row.stages[memory.stage].reaction if reacts else "notice"


def _aged(memory: Memory | None, pilot: tuple[int, int], now: Ns) -> Memory | None:
    """Is it still a short one? Judged before it ends."""
    if memory is None or memory.long:
        return memory
    lasted = memory.holds and now - memory.since_ns >= SHORT_NS
    return replace(memory, long=True) if lasted or pilot != memory.pilot else memory


def _acts(row: FailsafeRow, memory: Memory) -> bool:
    return memory.overruled is None and row.stages[memory.stage].reaction in ACTING
