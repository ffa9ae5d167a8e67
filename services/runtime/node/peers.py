"""Who else speaks: a side with another version of Lindy, and two processes of one name.

Pure: what was heard, and `now`. A second process of a name is recognised by its instance: it is
there as long as the older one is still heard after the younger one. After a restart it is not.
"""

from dataclasses import dataclass

from messages.health import Health
from messages.identity import SideIdentity, difference
from messages.units import Ns

RECENT_NS = 3_000_000_000  # [ns] everybody speaks once a second
PATIENCE_NS = 3_000_000_000  # [ns] in which the other side says who it is
MOST = 8  # other sides that are told apart
NO_TOPSIDE = "no topside answers: start one on the pilot's computer, with `lindy up topside`"


@dataclass(slots=True)
class Voice:
    """A process that calls itself by a service's name."""

    pid: int
    first_ns: Ns
    last_ns: Ns


class Peers:
    """What is heard of the others. Only services on board are looked at for doubles: two topsides
    are two pilots, who may take turns."""

    def __init__(self, ours: SideIdentity) -> None:
        self._ours = ours
        self._others: dict[int, tuple[SideIdentity, Ns]] = {}  # by instance
        self._voices: dict[str, dict[int, Voice]] = {}  # by service and instance; the oldest first
        self._expected_ns: Ns | None = None
        self._heard = self._met = False

    def expect(self, now: Ns) -> None:
        """The other side is another machine, and was heard: it must say who it is."""
        if self._expected_ns is None:
            self._expected_ns = now

    def identity(self, theirs: SideIdentity, now: Ns) -> None:
        if theirs.side in ("", self._ours.side):  # every version of Lindy names its side
            return
        self._met = True
        self._others[theirs.instance] = theirs, now
        self._forget(now)

    def health(self, health: Health, now: Ns) -> None:
        self._heard |= health.side not in ("", self._ours.side)
        if health.side == "drone" and health.instance:
            self.speaks(health.service, health.instance, health.pid, now)

    def speaks(self, service: str, instance: int, pid: int, now: Ns) -> None:
        """A process of this name was heard; or is this one, which does not hear itself."""
        voice = self._voices.setdefault(service, {}).setdefault(instance, Voice(pid, now, now))
        voice.last_ns = now

    def wrong(self, now: Ns) -> str:
        """Why nobody should arm, in words for the pilot; empty: all is well."""
        self._forget(now)
        differing = (difference(self._ours, said) for said, _ in self._others.values())
        return next(filter(None, [self._silence(now), *differing, self._doubles(now)]), "")

    def _forget(self, now: Ns) -> None:
        """Those not heard of lately, and all but the newest few."""
        recent = [(who, it) for who, it in self._others.items() if now - it[1] <= RECENT_NS]
        self._others = dict(recent[-MOST:])

    def _silence(self, now: Ns) -> str:
        if self._met or self._expected_ns is None or now < self._expected_ns + PATIENCE_NS:
            return ""
        other = "drone" if self._ours.side == "topside" else "topside"
        if other == "topside" and not self._heard:
            return NO_TOPSIDE
        return f"the {other} does not say which Lindy it runs: install the same on both machines"

    def _doubles(self, now: Ns) -> str:
        for service, voices in self._voices.items():
            for instance in [i for i, v in voices.items() if now - v.last_ns > RECENT_NS]:
                del voices[instance]
            recent = [*voices.values()]
            both = [
                voice
                for k, voice in enumerate(recent)
                if any(voice.last_ns > younger.first_ns for younger in recent[k + 1 :])
                or any(older.last_ns > voice.first_ns for older in recent[:k])
            ]
            if both:
                pids = ", ".join(str(voice.pid) for voice in both)
                many = {2: "two", 3: "three"}.get(len(both), len(both))
                return f"{many} services call themselves {service}: pids {pids}"
        return ""
