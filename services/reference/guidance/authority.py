"""Who has control: exactly one pilot at every instant.

The rules:

1. Control is a lease with a number, its epoch. Every command and every request carries the epoch of
   its sender. The holder is whoever was granted the newest epoch.
2. Nobody holds control before the first grant, after a release, and once the holder's commands have
   been silent for `SILENT_NS`. A holder that was silent goes on with its next command, unless
   another pilot has taken control by then.
3. `lease`, which takes control or accepts an offer, is granted when nobody holds control or when
   the holder offers it to whoever asks. The holder's own `lease` withdraws its offer.
4. `offer` is granted to the holder: to one pilot by name or to anybody, for `OFFER_NS`.
5. `release` is granted to the holder, who gives control up, and to whoever it is offered to, who
   declines.
6. `force` takes control from any holder, and is announced.
7. `stop` is granted to anybody; `disarm` to the holder, to whoever's epoch still acts, and to
   anybody while nobody holds control; everything else to the holder.
8. A new epoch acts from its first command on. Until then the epoch before it goes on acting, at
   most for `HAND_OVER_NS`, so that a hand-over leaves no gap; afterwards it never acts again.
   A released epoch does not act.
9. Epochs grow, over restarts without a checkpoint too: those granted after a start are greater than
   the clock at that start in microseconds, and nobody grants one every microsecond.

Epoch 0 acts until the first grant, for a stack whose pilot asks for no lease.

Pure: state × (request or epoch of a command, now). Leases with growing numbers are known as fencing
tokens (Kleppmann, Designing Data-Intensive Applications, 2017, chapter 8).
"""

from dataclasses import dataclass, field

import msgspec
from msgspec.structs import replace

from messages.pilot import PilotRequest
from messages.units import Ns

# Longer than a cable is pulled by mistake or a link is out; the drone is at rest from 0.3 s on.
SILENT_NS = 10_000_000_000  # [ns]
OFFER_NS = 30_000_000_000  # [ns] time for another person to accept
HAND_OVER_NS = 2_000_000_000  # [ns] several round trips of the slowest link


class Lease(msgspec.Struct, frozen=True):
    """The newest grant. Checkpoint: a restart in mid-dive takes control from nobody."""

    epoch: int = 0  # newest granted; 0: none yet
    acting: int = 0  # epoch of the newest command that was admitted
    former_until_ns: int = 0  # [ns] so long `acting` is admitted where it is not `epoch`
    holder: str = ""  # name, for people
    since_ns: int = 0  # [ns] when it was granted
    released: bool = False
    request: str = ""  # id of the request that it was granted to


NONE_YET = Lease()


@dataclass(slots=True)
class ControlAuthority:
    """The state machine."""

    lease: Lease = NONE_YET
    started_ns: Ns = 0  # [ns] now, when this was made
    _heard_ns: Ns = field(init=False)  # newest command of the holder
    _offered_to: str | None = None  # a name; empty: anybody; None: nobody
    _offer_ends_ns: Ns = 0

    def __post_init__(self) -> None:
        self._heard_ns = self.started_ns  # whatever happened meanwhile, the holder gets its time

    # Commands.

    def admits(self, epoch: int, now: Ns) -> bool:
        """Does a command of this epoch move the drone?"""
        lease = self.lease
        if lease.released:
            return False
        return epoch == lease.epoch or (epoch == lease.acting and now < lease.former_until_ns)

    def heard(self, epoch: int, now: Ns) -> None:
        """A command of this epoch was admitted."""
        if epoch == self.lease.epoch:
            self._heard_ns = now
            if self.lease.acting != epoch:
                self.lease = replace(self.lease, acting=epoch)

    def holder(self, now: Ns) -> str:
        """Name of the pilot who has control; empty: nobody."""
        lease = self.lease
        held = lease.epoch > 0 and not lease.released and now < self._heard_ns + SILENT_NS
        return lease.holder if held else ""

    # Requests.

    def refusal(self, request: PilotRequest, now: Ns) -> str:
        """Why the sender has not the authority for a request; empty when it has."""
        nobody_holds = not self.holder(now)
        match request.kind:
            case "stop" | "force":
                granted = True
            case "lease":
                granted = nobody_holds or self._is_holder(request) or self._is_offered(request, now)
            case "disarm":
                acts = self.admits(request.epoch, now)
                granted = nobody_holds or acts or self._is_holder(request)
            case "offer":
                granted = self._is_holder(request)
            case "release":
                granted = self._is_holder(request) or self._is_offered(request, now)
            case _:
                granted = self._is_holder(request) or request.epoch == self.lease.epoch == 0
        return "" if granted else self._why_not(now)

    def grant(self, request: PilotRequest, now: Ns) -> str:
        """Carry out a request of kind lease, force, offer or release that is not refused.

        Returns what is to be announced to all pilots, if anything.
        """
        who, before, mine = _name(request), self.lease.holder, self._is_holder(request)
        offered, self._offered_to = self._offered_to, None
        match request.kind:
            case "offer":
                self._offered_to, self._offer_ends_ns = request.to, now + OFFER_NS
                to = request.to or "anybody"
                return f"{before} offers control to {to} for {OFFER_NS / 1e9:.0f} s"
            case "release" if mine:
                self.lease = replace(self.lease, released=True)
                return f"{before} has released control"
            case "release":
                return f"{who} declines the control that {before} offers"
            case _ if mine:
                return f"{before} keeps control" if offered is not None else ""
            case _:
                held = self.holder(now)
                self._begin(request, now)
                by_force = " by force" if request.kind == "force" else ""
                return f"{who} has taken control from {held}{by_force}" if held else ""

    def _begin(self, request: PilotRequest, now: Ns) -> None:
        """A new epoch."""
        old = self.lease
        self.lease = Lease(
            epoch=max(old.epoch, self.started_ns // 1000) + 1,
            acting=old.acting,
            former_until_ns=0 if old.released else now + HAND_OVER_NS,
            holder=_name(request),
            since_ns=now,
            request=request.id,
        )
        self._heard_ns = now

    def _is_holder(self, request: PilotRequest) -> bool:
        """Was the newest epoch granted to the sender? Its epoch says so, or, as long as the answer
        has not reached it, the id of its request, which it repeats."""
        lease = self.lease
        if lease.epoch == 0 or lease.released:
            return False
        return request.epoch == lease.epoch or request.id == lease.request

    def _is_offered(self, request: PilotRequest, now: Ns) -> bool:
        return self._offered_to in ("", _name(request)) and now < self._offer_ends_ns

    def _why_not(self, now: Ns) -> str:
        if not (holder := self.holder(now)):
            return "nobody has control; take it first"
        seconds = max(0, now - self.lease.since_ns) / 1e9
        return f"{holder} has had control for {seconds:.0f} s; ask for an offer, or take by force"


def _name(request: PilotRequest) -> str:
    return request.source or "a pilot"
