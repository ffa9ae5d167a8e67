"""Who has control: two pilots in any order of requests, commands and silences, rule by rule."""

from typing import get_args

from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, rule

from messages.pilot import PilotRequest, RequestKind
from services.reference.guidance.authority import (
    HAND_OVER_NS,
    OFFER_NS,
    SILENT_NS,
    ControlAuthority,
)

S = 1_000_000_000  # [ns]
PILOTS = st.sampled_from(["ann", "bob"])
OTHERS = [k for k in get_args(RequestKind) if k not in ("lease", "force", "offer", "release")]


class Drone:
    """A clock, an authority, and what its answers have told each pilot."""

    def __init__(self, started: int = 0) -> None:
        self.now, self.asked = started, 0
        self.authority = ControlAuthority(started_ns=started)
        self.epochs = {"ann": 0, "bob": 0, "cleo": 0}

    def ask(self, who: str, kind: RequestKind, to: str = "") -> str:
        """Why it was refused; empty: it was granted."""
        self.asked += 1
        request = PilotRequest(
            stamp_ns=0, id=f"{self.asked}", kind=kind, to=to, source=who, epoch=self.epochs[who]
        )
        reason = self.authority.refusal(request, self.now)
        if not reason and kind in ("lease", "force", "offer", "release"):
            self.authority.grant(request, self.now)
        if not reason and kind in ("lease", "force"):
            self.epochs[who] = self.authority.lease.epoch
        return reason

    def command(self, who: str) -> bool:
        """Did a command of this pilot move the drone?"""
        admitted = self.authority.admits(self.epochs[who], self.now)
        if admitted:
            self.authority.heard(self.epochs[who], self.now)
        return admitted

    @property
    def holder(self) -> str:
        return self.authority.holder(self.now)


def held_by_ann() -> Drone:
    drone = Drone()
    assert drone.ask("ann", "lease") == ""
    assert drone.command("ann")
    drone.now += S
    return drone


def test_reasons_and_announcements_are_in_plain_words():
    drone = held_by_ann()
    drone.now += 11 * S
    assert drone.ask("bob", "light") == "nobody has control; take it first"
    drone.command("ann")
    words = "ann has had control for 12 s; ask for an offer, or take by force"
    assert {drone.ask("bob", k) for k in OTHERS if k != "stop"} == {words}
    assert drone.ask("bob", "lease") == drone.ask("bob", "offer") == words
    assert drone.ask("bob", "stop") == ""
    force = PilotRequest(stamp_ns=0, id="x", kind="force", source="bob")
    assert drone.authority.grant(force, S) == "bob has taken control from ann by force"
    offer = PilotRequest(stamp_ns=0, id="y", kind="offer", source="bob", epoch=2, to="ann")
    assert drone.authority.grant(offer, S) == "bob offers control to ann for 30 s"


def test_control_is_free_exactly_when_the_holder_has_been_silent_for_long_enough():
    drone = held_by_ann()
    drone.now = SILENT_NS - 1
    assert (drone.holder, drone.ask("bob", "lease") == "") == ("ann", False)
    drone.now = SILENT_NS
    assert drone.holder == ""
    assert drone.ask("bob", "disarm") == ""
    assert drone.ask("bob", "lease") == ""
    assert drone.holder == "bob"


def test_an_offer_is_for_whom_it_names_and_ends():
    drone = held_by_ann()
    assert drone.ask("ann", "offer", to="cleo") == ""
    assert drone.ask("bob", "lease") != ""
    drone.now += OFFER_NS - 1
    drone.command("ann")
    assert drone.ask("cleo", "lease") == ""
    drone.command("cleo")
    assert drone.ask("cleo", "offer") == ""
    drone.now += OFFER_NS
    drone.command("cleo")
    assert drone.ask("bob", "lease") != ""


def test_a_lease_that_is_asked_again_with_the_same_id_is_the_same_lease():
    drone = held_by_ann()
    again = PilotRequest(stamp_ns=0, id="1", kind="lease", source="ann")
    restarted = ControlAuthority(drone.authority.lease, drone.now)  # it knows no answers any more
    assert restarted.refusal(again, drone.now) == ""
    restarted.grant(again, drone.now)
    assert restarted.lease.epoch == drone.epochs["ann"]


def test_the_pilot_before_flies_on_until_the_new_one_speaks_and_not_for_ever():
    drone = held_by_ann()
    assert drone.ask("bob", "force") == ""
    drone.now += HAND_OVER_NS - 1
    assert drone.command("ann")
    drone.now += 1
    assert not drone.command("ann")
    assert drone.command("bob")
    drone.ask("cleo", "force")
    assert drone.command("bob")
    assert drone.command("cleo")
    assert not drone.command("bob")


def test_epochs_grow_over_a_restart_without_memory():
    drone = Drone()
    for who in ("ann", "bob", "cleo"):
        drone.ask(who, "force")
    assert list(drone.epochs.values()) == [1, 2, 3]
    later = Drone(started=S // 2)
    later.ask("ann", "lease")
    assert later.epochs["ann"] > 3


class AnyOrder(RuleBasedStateMachine):
    """Against an account of its own."""

    def __init__(self) -> None:
        super().__init__()
        self.drone = Drone()
        self.acting = 0  # newest epoch that moved the drone
        self.owner: dict[int, str] = {}
        self.heard_ns = 0
        self.free = True  # never granted, or released
        self.offered = False

    @rule(seconds=st.sampled_from([0.1, 1.0, 5.0, 12.0, 31.0]))
    def time_passes(self, seconds: float) -> None:
        self.drone.now += round(seconds * S)

    @rule(who=PILOTS)
    def moves_a_stick(self, who: str) -> None:
        epoch = self.drone.epochs[who]
        if self.drone.command(who):
            assert epoch >= self.acting, "an older epoch never acts again"
            assert epoch == 0 or self.owner[epoch] == who
            assert epoch == 0 or not self.free
            self.acting = epoch
            if epoch and epoch == max(self.owner):
                self.heard_ns = self.drone.now
        else:
            assert epoch not in self.owner or epoch != max(self.owner) or self.free

    @rule(who=PILOTS, kind=st.sampled_from(["lease", "force"]))
    def takes_control(self, who: str, kind: RequestKind) -> None:
        silent = self.drone.now >= self.heard_ns + SILENT_NS
        has_it = bool(self.owner) and self.owner[max(self.owner)] == who and not self.free
        granted = self.drone.ask(who, kind) == ""
        if kind == "force" or self.free or silent or has_it:
            assert granted
        elif granted:
            assert self.offered
        if granted:
            self.offered = False
            if not has_it:
                self.owner[self.drone.epochs[who]] = who
            if not has_it:
                self.free, self.heard_ns = False, self.drone.now
            assert self.drone.epochs[who] == max(self.owner)

    @rule(who=PILOTS, kind=st.sampled_from(["offer", "release"]))
    def gives_it_away(self, who: str, kind: RequestKind) -> None:
        has_it = bool(self.owner) and self.owner[max(self.owner)] == who and not self.free
        granted = self.drone.ask(who, kind) == ""
        assert granted or not has_it
        if granted and kind == "offer":
            assert has_it
            self.offered = True
        elif granted:
            assert has_it or self.offered
            self.free, self.offered = self.free or has_it, False

    @rule(who=PILOTS, kind=st.sampled_from(OTHERS))
    def asks_for_something_else(self, who: str, kind: RequestKind) -> None:
        holds = not self.owner or (self.owner[max(self.owner)] == who and not self.free)
        nobody = self.free or self.drone.now >= self.heard_ns + SILENT_NS
        acts = self.drone.authority.admits(self.drone.epochs.get(who, 0), self.drone.now)
        granted = self.drone.ask(who, kind) == ""
        assert granted == (holds or kind == "stop" or (kind == "disarm" and (nobody or acts)))

    @rule()
    def reference_restarts(self) -> None:
        self.drone.authority = ControlAuthority(self.drone.authority.lease, self.drone.now)
        self.heard_ns, self.offered = self.drone.now, False

    @invariant()
    def the_status_names_who_has_control(self) -> None:
        silent = self.drone.now >= self.heard_ns + SILENT_NS
        nobody = self.free or silent
        assert self.drone.holder == ("" if nobody else self.owner[max(self.owner)])


AnyOrder.TestCase.settings = settings(max_examples=60, stateful_step_count=40, deadline=None)
test_whatever_happens_in_whatever_order_control_is_one_pilots = AnyOrder.TestCase
