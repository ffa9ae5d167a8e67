"""A script as a stick source: plays a stick log from the moment the sticks are handed over."""

from bisect import bisect_right
from typing import NamedTuple

from messages.events import Outbox
from services.gamepad.stick_log import StickLog
from services.piloting.pilot_intents import Intent
from services.piloting.sticks import Incident, StickReading

QUIET_NS = 3_000_000_000  # [ns] of centred sticks after the script, before the drone is disarmed


class Cue(NamedTuple):
    at_ns: int  # [ns] since the script began
    what: Intent | Incident


class Player:
    """Each event happens once: `played` events have happened, before a restart included."""

    def __init__(self, name: str, script: StickLog, outbox: Outbox, played: int = 0) -> None:
        self.name = f"script {name}"
        self.played = played
        self._script, self._outbox = script, outbox
        self._cues = [
            Cue(row.at_ns, row.event)
            for row in script.rows
            if row.event is not None and row.event != "lost"
        ]
        self._cues.append(Cue(script.duration_ns + QUIET_NS, "disarm"))
        self._changes = [row.at_ns for row in script.rows] + [self._cues[-1].at_ns]

    def read(self, now: int, began: int | None) -> StickReading:
        """Sticks of this instant, and all events that are due and have not happened yet."""
        if began is None:
            return StickReading()
        presses, incidents = list[Intent](), list[Incident]()
        while self.played < len(self._cues) and self._cues[self.played].at_ns <= now - began:
            what = self._cues[self.played].what
            self.played += 1
            if isinstance(what, Incident):
                incidents.append(what)
            else:
                presses.append(what)
            if self.played == len(self._cues):
                self._outbox.say("info", "the script has ended")
        row = self._script.at(now - began)
        return StickReading(
            sticks=row.sticks,
            present=row.event != "lost",
            at_rest=row.sticks.at_rest,
            presses=tuple(presses),
            incidents=tuple(incidents),
        )

    def next_ns(self, now: int, began: int) -> int | None:
        """[ns] Time of the next row, or of the disarming after the last one."""
        index = bisect_right(self._changes, now - began)
        return None if index == len(self._changes) else began + self._changes[index]
