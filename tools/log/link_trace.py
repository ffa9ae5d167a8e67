"""`lindy log export --as trace`: when messages of a recorded dive were sent, and when they arrived.

The recorder is on board. Where both ends have one clock, the pilot's commands give the delay from
topside to drone: arrival − stamp; a gap in the sequence numbers is a loss. Where the clocks differ,
only whole round trips can be measured, and half of each is the best estimate of either direction.
"""

from collections.abc import Iterable
from pathlib import Path
from typing import NamedTuple

from messages import topics
from messages.link import Clock
from messages.pilot import PilotCommand
from services.runtime.config.errors import LindyError
from services.tether.delay import LONGEST_MS
from tools.fresh import refuse_existing, write_fresh
from tools.recordings.recording import open_recording

ONE_CLOCK_NS = 1_000_000  # [ns] clocks that differ by less, or by less than the error, count as one
MOST_MISSING = 1000  # a larger gap in the count is another publisher, not a loss
TraceRow = tuple[float, float | None]  # sent [s], arrived [s] or lost


class Traced(NamedTuple):
    rows: list[TraceRow]  # ascending; the first is sent at 0
    remarks: list[str]  # how it was measured


class HeardCommand(NamedTuple):
    """A pilot command on board."""

    seq: int
    sent: int  # [ns] by the recorder's clock
    arrived: int  # [ns]


def write_trace(recording: Path, out: Path) -> int:
    """Write a trace for `delay = { kind = "trace", file = … }` in a profile: CSV whose first lines
    say how it was measured. Returns the exit status.

    Raises:
        LindyError: as `trace_of`, or the file is there already.
    """
    refuse_existing(out)
    found = trace_of(recording)
    lines = (f"{sent:.6f},{'' if at is None else f'{at:.6f}'}\n" for sent, at in found.rows)
    heading = "".join(f"# {line}\n" for line in found.remarks)
    write_fresh(out, (heading + "sent_s,arrived_s\n" + "".join(lines)).encode())
    lost = sum(at is None for _, at in found.rows)
    print(f"{out}: {len(found.rows)} messages, {lost} lost; {found.remarks[0]}", flush=True)
    return 0


def trace_of(path: Path) -> Traced:
    """
    Raises:
        LindyError: there is no recording, or nothing in it that gives delays.
    """
    commands: list[HeardCommand] = []
    clocks: list[Clock] = []
    recording = open_recording(path)
    for _, message, log_ns, publish_ns in recording.of(topics.PILOT_COMMAND, topics.CLOCK):
        if isinstance(message, PilotCommand):
            commands.append(HeardCommand(message.seq, publish_ns, log_ns))
        elif isinstance(message, Clock):
            clocks.append(message)
    # Before the clocks were known, the recorder took a command's arrival for its stamp.
    commands = [command for command in commands if command.sent != command.arrived] or commands
    if one_clock(clocks) and len(commands) > 1:
        clock = (
            "known to be one"
            if clocks
            else "assumed to be one: there is no clock offset in the recording"
        )
        how = "one way, down: arrival of pilot/command on board minus its stamp"
        return Traced(
            _checked(one_way(commands), path), [how, f"the clocks of both ends are {clock}"]
        )
    rows = half_trips(clocks)
    if not rows:
        raise LindyError(f"{path} holds neither pilot commands on one clock nor clock round trips")
    how = "half of each round trip of clock/ping, so the same in both directions"
    return Traced(_checked(rows, path), [how, "the clocks of both ends differ"])


def one_clock(clocks: Iterable[Clock]) -> bool:
    """Do both ends have one clock, as far as the link monitor knows?"""
    return all(
        abs(clock.offset_ns) <= max(ONE_CLOCK_NS, clock.bound_ns or 0)
        for clock in clocks
        if clock.offset_ns is not None
    )


def one_way(commands: list[HeardCommand]) -> list[TraceRow]:
    """Rows in seconds since the first command was sent. A lost one was sent evenly between its
    neighbours."""
    ordered = sorted(set(commands), key=lambda heard: (heard.sent, heard.seq))
    start = ordered[0].sent
    rows: list[TraceRow] = []
    before: HeardCommand | None = None
    for here in ordered:
        if before is not None and before.sent == here.sent:
            continue  # a copy
        if before is not None and 1 < here.seq - before.seq <= MOST_MISSING:
            step = (here.sent - before.sent) / (here.seq - before.seq)
            missing = range(1, here.seq - before.seq)
            rows += [((before.sent + k * step - start) / 1e9, None) for k in missing]
        rows.append(((here.sent - start) / 1e9, (here.arrived - start) / 1e9))
        before = here
    return rows


def half_trips(clocks: list[Clock]) -> list[TraceRow]:
    """Rows in seconds since the first trip; a ping without an answer was lost."""
    rows: list[TraceRow] = []
    first: int | None = None
    for clock in sorted(clocks, key=lambda clock: clock.stamp_ns):
        first = clock.stamp_ns if first is None else first
        sent = (clock.stamp_ns - first) / 1e9
        if not rows or sent > rows[-1][0]:
            rows.append((sent, None if clock.rtt_ms is None else sent + clock.rtt_ms / 2e3))
    return rows


def _checked(rows: list[TraceRow], path: Path) -> list[TraceRow]:
    """
    Raises:
        LindyError: a message arrived before it was sent, or later than any link model knows.
    """
    for sent, arrived in rows:
        if arrived is not None and not 0.0 <= arrived - sent <= LONGEST_MS / 1e3:
            raise LindyError(
                f"{path}: a message sent at {sent:.3f} s arrived {arrived - sent:.3f} s later; "
                "the clocks of both ends differ, and their offset was not recorded"
            )
    return rows
