"""Access to a drone's hub, with real sessions over TLS: every act that is allowed, and every act
that is forbidden, is tried.

That nothing came is only believed after a message that was sent later has come, or after the hub
has seen the attacker's link end.
"""

import time
from collections.abc import Callable, Generator, Iterable
from contextlib import ExitStack
from datetime import UTC, datetime, timedelta
from pathlib import Path

import msgspec
import pytest
import zenoh

from messages import topics
from messages.topic import AnyTopic, Direction
from services.runtime.bus.access_control import HubSide, KeyFiles
from services.runtime.bus.envelope import Envelope
from services.runtime.bus.spaces import namespace
from services.runtime.bus.zenoh_bus import ZenohBus, config, connected, listening, watch_callers
from services.runtime.config.errors import LindyError
from services.runtime.config.stack import REPLAY
from tests.support.doors import CROSS, free_endpoint, one, say
from tests.support.patience import PATIENCE_S, until
from tools.keys.authority import CA, CERTIFICATE, KEY, KeyAuthority, own_keys
from tools.keys.credentials import parse

REFUSED_S = 0.2  # [s] attempts of a caller who is to be refused
SPACE = namespace("pioneer")
NOW = datetime.now(UTC)
END = b"the attack is over"
UP = [topic for topic in topics.ALL if topic.way in (Direction.UP, Direction.BOTH)]


def keys_into(heard: list[str]) -> "zenoh.handlers.Callback[zenoh.Sample]":
    def hear(sample: zenoh.Sample) -> None:
        heard.append(str(sample.key_expr))

    return zenoh.handlers.Callback(hear, indirect=False)


def delete(session: zenoh.Session, rows: Iterable[AnyTopic]) -> None:
    for topic in rows:
        session.delete(one(topic).key)


class Keys:
    """Folders of keys: `ours`, and `foreign`, which another authority made with the same names."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        ours, foreign = folder / "ours", folder / "foreign"
        for place in (ours, foreign):
            KeyAuthority(place).make(NOW - timedelta(days=60))
        for name in ("drone:pioneer", "drone:other", "pilot:ann", "pilot:late", "observer:eve"):
            when = NOW - timedelta(days=30) if name == "pilot:late" else NOW
            KeyAuthority(ours).add(parse(name), when, 10)
        KeyAuthority(ours).add(parse("pilot:gone"), NOW, 10)
        KeyAuthority(ours).revoke(parse("pilot:gone"))
        KeyAuthority(foreign).add(parse("pilot:ann"), NOW, 10)
        KeyAuthority(foreign).add(parse("drone:pioneer"), NOW, 10)

    def files(self, bundle: str) -> KeyFiles:
        place = self.folder / bundle
        return KeyFiles(*(str(place / name) for name in (CA, CERTIFICATE, KEY)))

    def mixed(self, bundle: str) -> KeyFiles:
        """Somebody's keys, with our authority to compare with: as one who trusts us would come."""
        return self.files(bundle)._replace(authority=self.files("ours/drone-pioneer").authority)


class Drone:
    """A drone's hub with its keys, and a service on board that hears everything."""

    def __init__(self, keys: Keys, folder: Path, exits: ExitStack) -> None:
        self.keys, self.address = keys, free_endpoint("tls")
        credentials = own_keys(keys.folder / "ours/drone-pioneer", ("drone",), NOW)[1]
        border, private = (
            HubSide("drone", SPACE, credentials),
            f"unixsock-stream/{folder}/drone.sock",
        )
        hub = exits.enter_context(listening(self.address, private, hub_side=border))
        self.callers: list[tuple[str, bool]] = []
        self._watching = watch_callers(hub, lambda name, on: self.callers.append((name, on)))
        self.board = exits.enter_context(connected(private, SPACE, PATIENCE_S))
        self.outside = exits.enter_context(
            zenoh.open(config("client", connect=[private]))
        )  # on board, but hears every namespace
        self.bus, self.heard, self.everything = ZenohBus(self.board), list[Envelope](), list[str]()
        self.bus.hear("**", self.heard.append)
        ear = keys_into(self.everything)
        self._ears = [
            self.outside.declare_subscriber(k, ear) for k in ("**", "**/@v1/**", "@v9/**")
        ]

    def session(self, bundle: str, space: str | None = SPACE) -> zenoh.Session:
        files = self.keys.mixed(bundle)
        if space is not None:
            return connected(self.address, space, REFUSED_S, keys=files)
        return zenoh.open(config("client", connect=[self.address], keys=files))

    def attacked_by(
        self, bundle: str, act: Callable[[zenoh.Session], object], space: str | None = SPACE
    ) -> set[str]:
        """Keys that were heard on board of what somebody did."""
        self.heard.clear()
        self.everything.clear()
        name = bundle.rpartition("/")[2].replace("-", ":")
        gone = self.callers.count((name, False))
        with self.session(bundle, space) as session:
            act(session)
        until(lambda: self.callers.count((name, False)) > gone)
        with self.session("ours/pilot-ann") as pilot:  # behind all of it
            say(pilot, "log/end", END)
            until(lambda: any(e.payload == END for e in self.heard))
        return {e.key for e in self.heard if e.payload != END}


def say_all(session: zenoh.Session) -> None:
    for topic in topics.ALL:
        say(session, one(topic).key, b"x")


@pytest.fixture(scope="module")
def keys(tmp_path_factory: pytest.TempPathFactory) -> Keys:
    return Keys(tmp_path_factory.mktemp("keys"))


@pytest.fixture(scope="module")
def drone(keys: Keys, tmp_path_factory: pytest.TempPathFactory) -> Generator[Drone]:
    with ExitStack() as exits:
        yield Drone(keys, tmp_path_factory.mktemp("hub"), exits)


# Who is let in at all.


def test_another_authoritys_or_an_expired_certificate_is_refused(
    drone: Drone, tmp_path: Path
) -> None:
    """And one that somebody signed alone."""
    KeyAuthority(tmp_path).make(NOW)
    own, ours = str(tmp_path / "authority/ca.pem"), drone.keys.mixed("ours/pilot-ann").authority
    alone = KeyFiles(ours, own, own.replace(".pem", ".key"))
    for files in (*map(drone.keys.mixed, ("foreign/pilot-ann", "ours/pilot-late")), alone):
        with pytest.raises(LindyError, match="no hub answers"):
            connected(drone.address, SPACE, REFUSED_S, keys=files)


def test_without_a_certificate_or_without_tls_nobody_connects(drone: Drone) -> None:
    plain = drone.address.replace("tls/", "tcp/")
    for settings in (
        config("client", connect=[drone.address]),
        config("client", connect=[plain]),
    ):
        settings.insert_json5("connect/timeout_ms", "200")
        with pytest.raises(zenoh.ZError):
            zenoh.open(settings)


# What each may say.


def test_a_pilot_says_the_rows_that_go_down_and_no_others(drone: Drone) -> None:
    heard = drone.attacked_by("ours/pilot-ann", say_all)
    assert heard == {one(t).key for t in CROSS if t.way in (Direction.DOWN, Direction.BOTH)}
    for key in ("control/thrusters", "sensor/imu", "state", "vehicle/status", "simulator/request"):
        assert key not in heard


COMMAND = msgspec.msgpack.encode({"stamp_ns": 0, "seq": 2**63, "source": "x", "epoch": 10**9})
BAD_TEXT = b"\x81\xa6source\xa1\xff"  # a text that is no text
LATER = msgspec.msgpack.encode({"stamp_ns": 0, "seq": 2**64 - 1, "offset_ns": None})
ATTACKS: dict[str, Callable[[zenoh.Session], object]] = {
    "command": lambda s: say(s, "pilot/command", COMMAND),
    "bad text": lambda s: say(s, "pilot/command", BAD_TEXT),
    "disarm": lambda s: say(s, "pilot/request", b"\x81\xa4kind\xa6disarm"),
    "fault": lambda s: say(s, "simulator/request", b"\x80"),
    "cut": lambda s: say(s, "link/request", b"\x81\xa4kind\xa4down"),
    "clock": lambda s: say(s, "link/clock", LATER),
    "thrust": lambda s: say(s, "control/thrusters", COMMAND),
    "junk": lambda s: [say(s, "pilot/command", b"\xff" * 8) for _ in range(20_000)],
    "invented": lambda s: [say(s, f"health/z{n}", b"\x80") for n in range(2_000)],
    "huge": lambda s: say(s, "pilot/command", bytes(4_000_000)),
    "every row": say_all,
    "everything at once": lambda s: say(s, "**", b"x"),
    "a family": lambda s: say(s, "pilot/*", b"x"),
    "deleted": lambda s: delete(s, topics.ALL),
}


@pytest.mark.parametrize("who", ["ours/observer-eve", "ours/pilot-gone", "ours/drone-other"])
def test_observers_the_revoked_and_other_drones_say_nothing(drone: Drone, who: str) -> None:
    def attack(session: zenoh.Session) -> None:
        for act in ATTACKS.values():
            act(session)

    assert drone.attacked_by(who, attack) == set()
    assert drone.everything == [f"{SPACE}/log/end"]


REPLAYED = namespace(f"{REPLAY}/pioneer")
WILD = ("**", "*", "*/*", "control/*", "sensor/**", "simulator/*", "p$*/*")
ELSEWHERE = (
    f"{namespace('another')}/pilot/command", "lindy/@v2/pioneer/pilot/command", "pilot/command",
    "@v9/pilot/command", f"{SPACE}/pilot/command/more", f"{SPACE}/alive/control",
)  # fmt: skip
OWN = [topic for topic in topics.ALL if topic.way in (Direction.UP, Direction.STAY)]
# In whose name, in which namespace, and what is done.
ASTRAY: dict[str, tuple[str, str | None, Callable[[zenoh.Session], object]]] = {
    "a pilot's wildcards": ("ours/pilot-ann", SPACE, lambda s: [say(s, k, b"x") for k in WILD]),
    "other drones and versions": (
        "ours/pilot-ann", None, lambda s: [say(s, key, b"x") for key in ELSEWHERE],
    ),
    "what is the drone's own, deleted": ("ours/pilot-ann", SPACE, lambda s: delete(s, OWN)),
    "a pilot's replay": ("ours/pilot-ann", REPLAYED, say_all),
    "an observer's replay": ("ours/observer-eve", REPLAYED, say_all),
}  # fmt: skip


@pytest.mark.parametrize("what", ASTRAY)
def test_what_is_no_row_of_this_drone_reaches_nobody_on_board(drone: Drone, what: str) -> None:
    who, space, act = ASTRAY[what]
    assert drone.attacked_by(who, act, space=space) == set()
    assert drone.everything == [f"{SPACE}/log/end"]


# What each may hear.


class Ear:
    """Everything that somebody hears, asking for everything and for each row."""

    def __init__(self, session: zenoh.Session) -> None:
        self.heard: list[str] = []
        keep = keys_into(self.heard)
        asked = ["**", *(topic.key for topic in topics.ALL)]
        self._ears = [session.declare_subscriber(key, keep) for key in asked]


def test_pilots_and_observers_hear_what_goes_up_the_revoked_nothing(drone: Drone) -> None:
    let_in, others = (
        ("ours/pilot-ann", "ours/observer-eve"),
        ("ours/pilot-gone", "ours/drone-other"),
    )
    rows = {one(topic).key for topic in UP if topic in CROSS}
    with ExitStack() as exits:
        ears = {who: Ear(exits.enter_context(drone.session(who))) for who in (*others, *let_in)}

        def goes_through(key: str) -> bool:
            drone.board.put(key, b"x")
            return all(key in ears[who].heard for who in let_in)

        until(lambda: goes_through("log/begin"))
        for topic in topics.ALL:
            drone.board.put(one(topic).key, b"x")
        until(lambda: goes_through("log/end"))
        until(lambda: all(rows <= {*ears[who].heard} for who in let_in))
        for who in let_in:
            assert {*ears[who].heard} - {"log/begin", "log/end"} == rows
        assert [ears[who].heard for who in others] == [[], []]
    assert not rows & {"sensor/imu", "pilot/command", "pilot/request", "simulator/answer"}


# Questions, liveliness, and what the hub knows of itself.


@pytest.mark.parametrize("who", ["ours/pilot-ann", "ours/observer-eve", "ours/pilot-gone"])
def test_nobody_asks_what_no_row_answers(drone: Drone, who: str) -> None:
    answered: list[str] = []

    def answer(query: zenoh.Query) -> None:
        answered.append(str(query.key_expr))
        query.reply(query.key_expr, b"secret")

    with drone.board.declare_queryable("**", answer), drone.session(who, None) as session:
        for key in ("**", f"{SPACE}/state", f"{SPACE}/pilot/command", "@/**"):
            replies = session.get(key, timeout=1.0, allowed_destination=zenoh.Locality.REMOTE)
            assert [*replies] == []
        assert [*session.liveliness().get(f"{SPACE}/alive/*", timeout=1.0)] == []
        assert answered == []
        assert [r.ok is not None for r in drone.outside.get(f"{SPACE}/state")] == [True]


def test_a_pilot_neither_answers_for_the_drone_nor_seems_to_be_a_service(drone: Drone) -> None:
    seen: list[str] = []
    drone.bus.watch(lambda key, _: seen.append(key.rpartition("/")[2]))

    def lie(query: zenoh.Query) -> None:
        query.reply(query.key_expr, b"lie")

    def pretend(session: zenoh.Session) -> None:
        session.declare_queryable("**", lie)
        session.liveliness().declare_token("alive/control")
        session.liveliness().declare_token("alive/**")
        say(session, "log/pretended")
        until(lambda: any(e.key == "log/pretended" for e in drone.heard))
        assert [*drone.outside.get(f"{SPACE}/state", timeout=1.0)] == []

    drone.attacked_by("ours/pilot-ann", pretend)
    drone.bus.announce("estimation")
    until(lambda: "estimation" in seen)
    assert seen == ["estimation"]


# Who poses as the drone.


@pytest.mark.parametrize(
    ("server", "reached"),
    [("ours/drone-pioneer", True), ("ours/drone-other", False), ("ours/pilot-ann", False),
     ("foreign/drone-pioneer", False)],
)  # fmt: skip
def test_a_pilot_speaks_to_a_drone_on_the_list_only(
    keys: Keys, tmp_path: Path, server: str, reached: bool
) -> None:
    address, private = free_endpoint("tls"), f"unixsock-stream/{tmp_path}/top.sock"
    mine = own_keys(keys.folder / "ours/pilot-ann", ("pilot",), NOW)[1]
    mine = mine._replace(admitted=("drone:pioneer",))
    posing = config("router", [address], keys=keys.mixed(server))  # lets in all, hears all
    with ExitStack() as exits:
        fake = exits.enter_context(zenoh.open(posing))
        came = list[str]()
        _watching = watch_callers(fake, lambda name, _on: came.append(name))
        heard, shown = list[Envelope](), list[Envelope]()
        ears = ZenohBus(fake)
        for topic in topics.ALL:
            ears.hear(f"{SPACE}/{topic.key}", heard.append)
        border = HubSide("topside", SPACE, mine)
        exits.enter_context(listening(private, connect=[address], hub_side=border))
        pilot = ZenohBus(exits.enter_context(connected(private, SPACE, PATIENCE_S)))
        pilot.hear(topics.STATUS.key, shown.append)
        command = pilot.say(topics.PILOT_COMMAND)

        def both() -> bool:
            command(b"x")
            fake.put(f"{SPACE}/vehicle/status", b"all is well")
            return bool(heard) and bool(shown)

        if reached:
            until(both)
        else:
            ends = time.monotonic() + 0.5  # the hub tries again every 50 to 200 ms
            while time.monotonic() < ends:
                assert not both()
                time.sleep(0.02)
            assert (heard, shown) == ([], [])
            assert came == (["pilot:ann"] if server == "ours/drone-other" else [])
