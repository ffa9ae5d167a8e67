"""The list of drones that a pilot is shown: true, bounded, and which of them fit his topside."""

from typing import Any

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from messages import topics
from messages.fly import MOST_DRONES, DroneList
from messages.identity import SideIdentity
from messages.message import Message
from messages.topic import AnyTopic
from messages.vehicle import VehicleStatus
from services.runtime.bus.spaces import here_key, namespace
from tools.fleet.reachable import drone_list, misfit, still_armed
from tools.fleet.watching import GONE_NS, FleetWatch

NOW = 10_000_000_000
OURS = SideIdentity(
    side="topside", version="1.0", messages="same", vehicle="pioneer", vehicle_hash="a"
)


def identity(**more: Any) -> SideIdentity:
    given: dict[str, Any] = {
        "side": "drone", "version": "1.0", "messages": "same", "vehicle": "pioneer",
        "vehicle_hash": "a",
    }  # fmt: skip
    return SideIdentity(**(given | more))


class Network:
    """Drones, as they are heard."""

    def __init__(self) -> None:
        self.watch = FleetWatch("same")

    def announced(self, name: str) -> None:
        self.watch.token(here_key(namespace(name), "drone", "1"), True, NOW)

    def says(self, name: str, topic: AnyTopic, message: Message) -> None:
        payload = msgspec.msgpack.encode(message)
        self.watch.row(f"{namespace(name)}/{topic.key}", payload, NOW)

    def drone(self, name: str, said: SideIdentity, **status: Any) -> None:
        self.announced(name)
        self.says(name, topics.IDENTITY.of("drone"), said)
        given: dict[str, Any] = {"stamp_ns": 0, "activity": "ready", "armed": False}
        self.says(name, topics.STATUS, VehicleStatus(**(given | status)))

    def list(self, flown: str = "rov1", left: str = "") -> DroneList:
        made = drone_list(self.watch, OURS, flown, left, NOW)
        return msgspec.msgpack.decode(msgspec.msgpack.encode(made), type=DroneList)  # within limits


@pytest.mark.parametrize(
    ("theirs", "said"),
    [
        (identity(), ""),
        (identity(version="1.1"), "the drone runs Lindy 1.1; the topside runs 1.0: install"),
        (identity(messages="other"), "the drone runs Lindy 1.0, with other messages"),
        (identity(vehicle="bluerov"), "another vehicle than the topside: the table [vehicle] of b"),
        (identity(vehicle_hash="b"), "the table [vehicle] of pioneer differs, or a --set"),
        (identity(version="\x1b[2J" + "x" * 120), "the drone runs Lindy ?[2Jxxx"),
    ],
)
def test_a_drone_that_does_not_fit_is_refused_with_what_differs(theirs: SideIdentity, said: str):
    why = misfit("rov2", OURS, theirs)
    assert said in why
    assert why.isprintable()
    assert why.startswith("rov2 cannot be flown from here: ") == bool(said)
    assert len(why) < 300


def test_the_list_says_of_each_drone_what_a_pilot_chooses_by():
    network = Network()
    network.drone("rov1", identity(), activity="piloted", armed=True, pilot="ann")
    acts = {"failsafe": "leak", "reaction": "ascend", "activity": "stopping", "armed": True}
    network.drone("rov2", identity(vehicle="bluerov"), **acts)
    network.announced("rov3")
    made = network.list(left="rov9 holds")
    assert (made.flown, made.more, made.left) == ("rov1", 0, "rov9 holds")
    one, two, three = made.drones
    assert (one.name, one.vehicle, one.activity, one.armed, one.pilot) == (
        "rov1", "pioneer", "piloted", True, "ann",
    )  # fmt: skip
    assert (one.failsafe, one.alarms, one.misfit) == (False, "", "")
    assert (two.failsafe, two.alarms) == (True, "FAILSAFE leak: rising")
    assert two.misfit.startswith("the drone was started with another vehicle than the topside")
    assert (three.name, three.vehicle, three.alarms) == (
        "rov3", "", "is announced, but says nothing",
    )  # fmt: skip
    network.watch.token(here_key(namespace("rov2"), "drone", "1"), False, NOW)
    assert [drone.name for drone in network.list().drones] == ["rov1", "rov3"]


def test_drones_that_went_with_the_router_stay_on_the_list():
    network = Network()
    network.drone("rov2", identity(vehicle="bluerov"))
    network.watch.router(False, NOW)
    network.watch.token(here_key(namespace("rov2"), "drone", "1"), False, NOW)
    (two,) = network.list().drones
    assert (two.name, two.vehicle) == ("rov2", "bluerov")


@given(
    st.lists(
        st.tuples(
            st.sampled_from(["there", "gone", "gone", "router", "says", "says"]),
            st.sampled_from(["rov1", "rov2"]),
            st.booleans(),
            st.sampled_from([0, 0, NOW, GONE_NS]),
        ),
        max_size=30,
    )
)
def test_whatever_comes_and_goes_in_whatever_order_there_is_a_list(
    steps: list[tuple[str, str, bool, int]],
):
    network, now = Network(), NOW
    for what, name, yes, later in steps:
        now += later
        match what:
            case "there" | "gone":
                network.watch.token(here_key(namespace(name), "drone", "1"), what == "there", now)
            case "router":
                network.watch.router(yes, now)
            case _ if yes:
                said = VehicleStatus(stamp_ns=0, activity="ready", armed=False)
                network.says(name, topics.STATUS, said)
            case _:
                network.says(name, topics.IDENTITY.of("drone"), identity())
        rows = {row.name for row in network.watch.rows(now) if not row.gone}
        made = drone_list(network.watch, OURS, "rov1", "", now)
        assert {drone.name for drone in made.drones} == rows


def test_however_many_a_stranger_announces_those_that_speak_are_listed():
    network = Network()
    for number in range(300):
        network.announced(f"a{number:03}")
    network.drone("rov2", identity(), pilot="x\x07<b>" * 20, note="n" * 2000)
    network.drone("zebra", identity())
    made = network.list(flown="zebra", left="z" * 5000)
    assert len(made.drones) == MOST_DRONES
    assert [drone.name for drone in made.drones[:2]] == ["rov2", "zebra"]
    assert made.more + len(made.drones) == 302
    assert all(
        text.isprintable() and len(text) <= 200
        for drone in made.drones
        for text in (drone.pilot, drone.alarms, drone.name, drone.misfit)
    )


def test_a_pilot_who_goes_is_told_of_the_drones_that_he_left_armed():
    network = Network()
    for name, status in {
        "armed": {"armed": True},
        "flown": {"armed": True, "pilot": "ann"},
        "off": {},
        "not left": {"armed": True},
    }.items():
        network.drone(name.replace(" ", "-"), identity(), **status)
    said = still_armed({"armed", "flown", "off", "silent"}, network.watch.rows(NOW))
    assert said == [
        "armed is still armed, and nobody flies it: `lindy fly armed` takes it",
        "silent is not heard now: if it is armed, it holds, and rises later",
    ]
