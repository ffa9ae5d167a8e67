"""`docs/failsafes.md`, written from the failsafe table itself (`make docs`)."""

from messages.vehicle import Reaction
from services.reference.failsafe.table import SHORT_NS, FailsafeRow, FailsafeStage, table
from services.reference.settings import FailsafeSettings

HEADING = """# Failsafes

What the drone watches, what it does by itself, and what ends that. The drone acts on board, so it
needs no link. `make docs` writes this page from `services/reference/failsafe/table.py`. Times and
thresholds are the defaults of the table `[reference.failsafe]` of a vehicle file.

- **notice**: the pilot reads it. Nothing else happens.
- **limit**: the drone comes to rest at the limit and goes no further; `goto` and `follow` beyond
  the depth limit are refused.
- **stop**: it comes to rest smoothly, and holds depth, heading and, where it was held, position.
- **ascend**: it rises at `ascent_speed` to `surface_depth`, and stays there (**surface**). It
  waits while there is no state, and does not go down where it is higher already.

Of several conditions the gravest reaction acts. Notice and limit end with their condition. The
others end by `resume` (the arm button of the pad, Enter on the keyboard, `lindy ask resume`) or
`disarm`; until then the sticks do nothing. `resume` is refused while the condition holds, except
where the table says "at any time": the condition then acts again only when it has ended or become
worse. A loss of state, link or pilot of less than 2 s ends by itself once the same pilot's sticks
were centred for 0.3 s. A script resumes by itself.

STOP of a pilot is no failsafe: it brakes, holds and stays armed, and the sticks act again once
they were centred.

| condition | the pilot reads | when | what the drone does | ended by | what to do |
|---|---|---|---|---|---|
"""


def page() -> str:
    """The whole page."""
    return HEADING + "".join(f"{_line(row)}\n" for row in table(FailsafeSettings()))


def _line(row: FailsafeRow) -> str:
    stages = ", then ".join(map(_stage, row.stages))
    c = row.condition
    cells = (f"`{c.name}`", c.sentence, row.measured, stages, _ends_by(row), c.noticed.to_do)
    return f"| {' | '.join(cells)} |".replace("|  |", "| |")


def _ends_by(row: FailsafeRow) -> str:
    if not row.acts:
        return "itself"
    if row.overrule:
        return "resume, at any time"
    ended = "once it has ended"
    short = f"centred sticks after less than {SHORT_NS / 1e9:g} s, else "
    return f"{short}resume, {ended}" if row.brief else f"resume, {ended}"


def _stage(stage: FailsafeStage) -> str:
    last: dict[Reaction, str] = {"ascend": "ascend and stay at the surface"}
    does = last.get(stage.reaction, stage.reaction)
    return does if stage.after == 0.0 else f"after {stage.after:g} s {does}"
