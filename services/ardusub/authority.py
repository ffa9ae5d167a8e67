"""Who has the vehicle: Lindy, or somebody else at the same board.

Another ground station, the board's own failsafe or a button may disarm, arm or change the mode at
any time. That is obeyed at once: Lindy sends no more sticks, sets no mode and arms nothing until
its own pilot disarms and arms again.
"""

from dataclasses import dataclass

import msgspec

from messages.units import Ns
from services.mavlink_io.packet import MavCommand, MavlinkPacket, MavResult, command

MANUAL, SURFACE = 19, 9
MODES = {0: "STABILIZE", 1: "ACRO", 2: "ALT_HOLD", 3: "AUTO", 4: "GUIDED", 7: "CIRCLE",
         9: "SURFACE", 16: "POSHOLD", 19: "MANUAL", 20: "MOTOR_DETECT", 21: "SURFTRAK"}  # fmt: skip
LOST_NS = 3_000_000_000  # [ns] without a heartbeat of the board, which comes once a second
AGAIN_NS = 500_000_000  # [ns] before a command without an effect is repeated
REFUSED_NS = 1_000_000_000  # [ns] before arming is tried again after a refusal
SETTLED_NS = 200_000_000  # [ns] after arming, for a heartbeat that was already under way
SPOOL_NS = 520_000_000  # [ns] from arming until the motors follow
RECENT_NS = 3_000_000_000  # [ns] for which a text of the board may be the reason of what it does
DOUBT_NS = 500_000_000  # [ns] before a disarming is said: a restart is known by the board's clock


class TakenCheckpoint(msgspec.Struct, frozen=True):
    """For a restart in mid-dive: the new process must not take the vehicle back."""

    taken: bool = False


@dataclass(slots=True)
class BoardAuthority:
    board: int  # system
    disarm_after_ns: Ns
    before: TakenCheckpoint | None = None  # of the process that this one replaces
    taken: bool = False  # somebody else has the vehicle
    ours: bool = False  # armed by Lindy
    mode: int | None = None
    board_armed: bool = False
    said: str = ""  # why it was taken, until it is asked for by `to_say`
    _text: str = ""  # newest STATUSTEXT
    _text_ns: Ns = 0
    _doubt_until: Ns = 0  # `said` is not certain yet
    _wanted: bool = False  # the newest command's `armed`
    _commanded: Ns | None = None
    _heartbeat: Ns | None = None
    _asked: bool | None = None  # True: to arm, False: to disarm; None: nothing
    _try_at: Ns = 0
    _armed_ns: Ns = 0

    def __post_init__(self) -> None:
        if self.before is not None:
            self.taken = self._wanted = self.before.taken  # only a new arming takes it back

    # What Lindy's own pilot wants.

    def wish(self, armed: bool, now: Ns) -> None:
        """A command of our own was accepted."""
        if armed and not self._wanted:
            self.taken = False  # a deliberate arming
        self._wanted, self._commanded = armed, now

    def wants(self, now: Ns) -> bool:
        """To be armed: silence withdraws the wish."""
        silent = self._commanded is None or now - self._commanded > self.disarm_after_ns
        return self._wanted and not silent

    # What the board says.

    def heartbeat(self, armed: bool, mode: int, now: Ns) -> None:
        was_armed = self.board_armed
        resumed = self._heartbeat is None and self.before is not None  # armed by that process
        self._heartbeat, self.mode = now, mode
        self.board_armed = armed
        if armed and self._asked is True:
            self._begin(now)
        elif not armed and self._asked is False:
            self.ours, self._asked = False, None
        elif self.ours and not armed and now - self._armed_ns > SETTLED_NS:
            self._lose("was disarmed", now)
            self._doubt_until = now + DOUBT_NS
        elif not self.ours and armed and not was_armed and self._asked is None and not resumed:
            self._lose("was armed", now)
        if self.ours and mode != MANUAL:
            self._lose(f"was switched to {MODES.get(mode, f'mode {mode}')}", now)

    def text(self, text: str, now: Ns) -> None:
        """A STATUSTEXT: faster than the next heartbeat."""
        if self.ours and self._asked is None and text == "Disarming motors":
            self.board_armed = False
            self._lose("was disarmed", now)
        else:
            self._text, self._text_ns = text, now

    def reason(self, now: Ns) -> str:
        """What the board said lately, which may be why it does what it does; else empty."""
        return self._text if now - self._text_ns <= RECENT_NS else ""

    def to_say(self, now: Ns) -> str:
        """Why it was taken, once and when that is certain; else empty."""
        if now < self._doubt_until:
            return ""
        said, self.said = self.said, ""
        return said

    def acknowledged(self, number: int, result: int, now: Ns) -> bool:
        """An answer to a command. False: the board refuses to arm."""
        if number != MavCommand.COMPONENT_ARM_DISARM or self._asked is None:
            return True
        if result == MavResult.ACCEPTED:
            if self._asked:
                self._begin(now)
            else:
                self.ours, self._asked, self.board_armed = False, None, False
            return True
        self._asked, self._try_at = None, now + REFUSED_NS
        return False

    def rebooted(self) -> None:
        """Everything it had is gone, and nobody armed it since."""
        self.ours, self.taken, self._asked, self._heartbeat = False, self._wanted, None, None
        self.board_armed, self.mode = False, None
        self.said = self._text = ""

    def heard(self, now: Ns) -> bool:
        """Is the board there?"""
        return self._heartbeat is not None and now - self._heartbeat <= LOST_NS

    # What follows from it.

    def flies(self, now: Ns) -> bool:
        """Whether Lindy's thrust goes to the motors; else neutral, or nothing."""
        return self.ours and not self.taken and self.mode == MANUAL and self.heard(now)

    def spooled(self, now: Ns) -> bool:
        """Whether the motors follow the sticks by now."""
        return self.flies(now) and now - self._armed_ns >= SPOOL_NS

    @property
    def sends_sticks(self) -> bool:
        """While somebody else has the vehicle its sticks are theirs. In SURFACE neutral goes on, or
        the failsafe for silent sticks would stop the ascent."""
        return not self.taken or self.mode == SURFACE

    def due(self, now: Ns, *, may_arm: bool) -> list[MavlinkPacket]:
        """Commands to send now.

        Args:
            may_arm: the board is checked, and neutral sticks have been sent for a while.
        """
        if self.taken or not self.heard(now) or now < self._try_at:
            return []
        if self.wants(now):
            if self.ours or not may_arm:
                return []
            self._try_at = now + AGAIN_NS
            if self.mode != MANUAL:
                return [command(self.board, MavCommand.DO_SET_MODE, 1, MANUAL)]
            self._asked = True
            return [command(self.board, MavCommand.COMPONENT_ARM_DISARM, 1)]
        if not self.ours and self._asked is None:
            return []
        self._asked, self._try_at = False, now + AGAIN_NS
        return [command(self.board, MavCommand.COMPONENT_ARM_DISARM, 0)]

    def _begin(self, now: Ns) -> None:
        if not self.ours:
            self._armed_ns = now
        self.ours, self._asked, self.board_armed = True, None, True

    def _lose(self, how: str, now: Ns) -> None:
        reason = self.reason(now)
        why = f" (the board says: {reason})" if reason else ""
        self.ours, self.taken, self._asked, self._doubt_until = False, True, None, now
        self.said = f"it {how}, not by Lindy{why}; disarm and arm to go on"
