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

import msgspec
from msgspec.structs import replace

from messages.events import DOES, RESUMED_SHORT_LOSS, Outbox, Row, detail
from messages.message import Notice
from messages.units import Ns
from messages.vehicle import Reaction, Returns
from services.reference.failsafe.table import ACTING, SEVERITY, SHORT_NS, FailsafeRow, Holding

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
    # What follows from the memories.
    acting: FailsafeRow | None = None  # the gravest; of these one that holds, then the first
    since_ns: Ns | None = None  # [ns] when the acting condition began
    next_ns: Ns | None = None  # [ns] when the next stage of one that holds begins; None: none does
    resumable: bool = False  # something acts, and none of it holds
    returns: Returns | None = None  # what gives the sticks back to the pilot; None: he has them
    _holding: Conditions = field(default_factory=dict[str, Holding])
    _acting: tuple[tuple[FailsafeRow, Memory], ...] = ()  # in the order of the table

    def __post_init__(self) -> None:
        self._remember(self.memory)

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
        arms, self._holding, after = armed and not self.armed, holding, dict[str, Memory]()
        if not (holding or self.memory):
            self.armed, self.surfaced = armed, False
            return
        for row in self.rows:
            memory, held = self.memory.get(row.name), holding.get(row.name)
            if memory is not None and not memory.long:  # judged before it ends
                lasted = memory.holds and now - memory.since_ns >= SHORT_NS
                memory = replace(memory, long=lasted or pilot != memory.pilot)
            if held is not None:
                begun = Memory(now, pilot=pilot)
                after[row.name] = self._held(row, memory, begun, held, arms=arms, armed=armed)
            elif memory is not None and row.name in unknown:
                after[row.name] = memory
            elif memory is not None and armed and _acts(row, memory):
                after[row.name] = replace(memory, holds=False)
        self.armed = armed
        self._remember(after)
        rises = self.reaction in ("ascend", "surface")
        self.surfaced = rises and (self.surfaced or at_surface)

    def _held(
        self,
        row: FailsafeRow,
        before: Memory | None,
        begun: Memory,
        held: Holding,
        *,
        arms: bool,
        armed: bool,
    ) -> Memory:
        """Of a condition that holds. `begun`: the same, where it begins now."""
        now, after = begun.since_ns, before or begun
        worse = after.overruled is not None and held.level > after.overruled
        is_new = before is None or worse
        after = begun if worse else after
        if arms or not after.holds:
            after = replace(after, since_ns=now, holds=True, stage=0 if arms else after.stage)
        acted = not is_new and self.armed and _acts(row, after)
        stages = row.stages
        while (
            armed
            and after.stage + 1 < len(stages)
            and now - after.since_ns >= stages[after.stage + 1].after * 1e9
        ):
            after = replace(after, stage=after.stage + 1)
        if armed and _acts(row, after) and not acted:
            self.outbox.tell(row.condition.acted(detail=DOES[stages[after.stage].reaction]))
        elif is_new and row.told and stages[0].reaction not in ACTING:
            self.outbox.tell(
                row.condition.noticed(detail=detail(self._notice(row, row.condition.noticed)))
            )
        return after

    def _remember(self, memory: Mapping[str, Memory]) -> None:
        """The memories from now on, and what follows from them."""
        self.memory = memory
        known = [(row, memory[row.name]) for row in self.rows if row.name in memory]
        known = known if self.armed else []
        self._acting = acting = tuple((row, m) for row, m in known if _acts(row, m))
        row, gravest = max(acting, key=_gravity, default=(None, None))
        self.acting, self.since_ns = row, None if gravest is None else gravest.since_ns
        self.next_ns = min(
            (
                m.since_ns + round(row.stages[m.stage + 1].after * 1e9)
                for row, m in known
                if m.holds and m.overruled is None and m.stage + 1 < len(row.stages)
            ),
            default=None,
        )
        self.resumable = bool(acting) and not any(m.holds for _, m in acting)
        self.returns = None
        if acting:
            short = all(row.brief and m.stage == 0 and not m.long for row, m in acting)
            free = all(row.overrule for row, m in acting if m.holds)
            self.returns = "centre" if short else "resume" if free else "wait"

    # What the pilot does.

    def resume(self) -> str:
        """End what acts; where nothing acts, overrule what is about to. Returns why it is refused,
        or nothing."""
        ended = self._acting or tuple(  # what holds and will act, and may be overruled
            (row, memory)
            for row in self.rows
            if row.acts and row.overrule and self.armed
            if (memory := self.memory.get(row.name)) is not None and memory.overruled is None
        )
        if not ended:
            return "no failsafe acts: there is nothing to resume from"
        after = dict(self.memory)
        for row, memory in ended:
            if memory.holds and not row.overrule:
                return f"{row.condition.sentence}, still"
            del after[row.name]
            if memory.holds:
                level = self._holding.get(row.name, Holding()).level
                after[row.name] = replace(memory, overruled=level)
        self.surfaced = False
        self._remember(after)
        return ""

    def give_back(self) -> None:
        """The sticks were centred for long enough: a short loss that has ended acts no more."""
        if self.returns == "centre" and self.resumable:
            self.resume()
            self.outbox.tell(RESUMED_SHORT_LOSS())

    def disarm(self) -> None:
        """Forget what has ended."""
        self.armed = self.surfaced = False
        self._remember({name: memory for name, memory in self.memory.items() if memory.holds})

    # What is said.

    @property
    def reaction(self) -> Reaction | None:
        """What the drone does now."""
        if self.acting is None:
            return None
        reaction = self.acting.stages[self.memory[self.acting.name].stage].reaction
        return "surface" if reaction == "ascend" and self.surfaced else reaction

    @property
    def holding(self) -> tuple[str, ...]:
        """Names of all conditions that hold, in the order of the table."""
        return tuple(self._holding)

    @property
    def acts(self) -> tuple[Notice, ...]:
        """Every condition that acts, also what has ended."""
        return tuple(self._notice(row, row.condition.acted) for row, _ in self._acting)

    @property
    def notices(self) -> tuple[Notice, ...]:
        """Every condition that holds and does not act."""
        acting = [row for row, _ in self._acting]
        said = [row for row in self.rows if row.name in self._holding and row not in acting]
        return tuple(self._notice(row, row.condition.noticed) for row in said)

    def _notice(self, row: FailsafeRow, event: Row) -> Notice:
        held = self._holding.get(row.name, Holding())
        return Notice(event.name, dict(held.numbers), held.about)


def _acts(row: FailsafeRow, memory: Memory) -> bool:
    return memory.overruled is None and row.stages[memory.stage].reaction in ACTING


def _gravity(acting: tuple[FailsafeRow, Memory]) -> tuple[int, bool]:
    row, memory = acting
    return SEVERITY.index(row.stages[memory.stage].reaction), memory.holds
