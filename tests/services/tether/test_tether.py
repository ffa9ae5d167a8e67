"""The tether: late by what its profile says, in order, byte for byte, and nothing else."""

from pathlib import Path
from typing import Any

import msgspec
import pytest

from messages import topics
from messages.link import LinkAnswer, LinkRequest, LinkStatus
from messages.topic import Direction
from services.runtime.bus.envelope import Envelope
from services.runtime.config.stack import Stack
from services.runtime.hosts.stack_file import ServiceSpec
from services.runtime.hosts.virtual_host import VirtualHost
from services.tether.service import damaged
from tests.support.said import sticks

MS = 1_000_000
GATEWAY = ServiceSpec(sides=["topside", "drone"], gateway=True)


PAYLOAD = b"\x00 any bytes \xff"  # what the tether says by itself is another


def crossed(source: str, target: str) -> set[str]:
    """Keys in one realm, of what was put on all of them in the other."""
    host, keys = VirtualHost(), [topic.key.replace("*", "somebody") for topic in topics.ALL]
    host.add("tether", GATEWAY, Stack(link="perfect", seed=5))
    arrived: list[Envelope] = []
    host.side(target).hear("**", arrived.append)
    for key in keys:
        host.side(source).forward(Envelope(key, PAYLOAD, "some/encoding", attachment=b"note"))
    host.nodes["tether"].step()
    host.run(100 * MS)
    through = [e for e in arrived if e.payload == PAYLOAD]
    assert all((e.encoding, e.attachment) == ("some/encoding", b"note") for e in through)
    found = {e.key for e in through}
    assert len(through) == len(found)
    return found


@pytest.mark.parametrize("way", [Direction.DOWN, Direction.UP])
def test_each_row_crosses_in_its_own_direction_only_byte_for_byte(way: Direction) -> None:
    ends = ("topside", "drone") if way is Direction.DOWN else ("drone", "topside")
    own = (topics.LINK, topics.LINK_ANSWER)  # the tether says these itself, in both realms
    assert crossed(*ends) == {
        topic.key.replace("*", "somebody")
        for topic in topics.ALL
        if topic.way in (way, Direction.BOTH) and topic not in own
    }


def test_status_is_heard_in_both_realms_and_what_nothing_has_passed_yet_has_no_delay() -> None:
    host = VirtualHost()
    host.add("tether", GATEWAY, Stack(link="remote"))
    heard: dict[str, LinkStatus] = {}
    pilot, drone = host.node("pilot", ["topside"]), host.node("drone", ["drone"])
    pilot.each(topics.LINK, lambda m, _: heard.update(topside=m))
    drone.each(topics.LINK, lambda m, _: heard.update(drone=m))
    host.run(900 * MS)  # before anybody says how it is doing
    assert heard["topside"].up
    assert (heard["topside"].rtt_ms, heard["topside"].down_link.loss) == (None, None)
    host.run(3_000 * MS)
    assert heard.keys() == {"topside", "drone"}
    assert heard["topside"].up_link.forwarded > 0  # health crosses once a second


# A running link is changed.


class Running:
    """A tether, somebody at each end, and a stream of commands down."""

    def __init__(self, link: str = "tether") -> None:
        self.host = VirtualHost()
        self.tether = self.host.add("tether", GATEWAY, Stack(link=link, seed=5))
        self.pilot = self.host.node("pilot", ["topside"])
        self.drone = self.host.node("drone", ["drone"])
        self.answers: dict[str, list[LinkAnswer]] = {"topside": [], "drone": []}
        self.statuses: list[LinkStatus] = []
        self.logs: list[str] = []
        self.delays: list[int] = []  # [ns] of commands
        self.pilot.each(topics.LINK_ANSWER, lambda m, _: self.answers["topside"].append(m))
        self.drone.each(topics.LINK_ANSWER, lambda m, _: self.answers["drone"].append(m))
        self.pilot.each(topics.LINK, lambda m, _: self.statuses.append(m))
        self.tether.show = lambda line: self.logs.append(line.text)
        self.drone.each(topics.PILOT_COMMAND, lambda m, now: self.delays.append(now - m.stamp_ns))
        self._request = self.pilot.publisher(topics.LINK_REQUEST)
        command = self.pilot.publisher(topics.PILOT_COMMAND)
        self.pilot.every(50.0, lambda now: command.put(sticks(now)))

    def run(self, seconds: float) -> "Running":
        self.host.run(self.host.now + round(seconds * 1000 * MS))
        return self

    def ask(self, kind: str, id_: str = "", **more: Any) -> LinkAnswer:
        request = LinkRequest(stamp_ns=self.host.now, id=id_ or kind, kind=kind, **more)  # type: ignore[arg-type]
        self._request.put(request)
        self.tether.step()
        self.pilot.step()
        return self.answers["topside"][-1]


def test_a_request_is_carried_out_once_and_answered_in_both_realms_each_time() -> None:
    running = Running().run(1.0)
    for _ in range(3):
        answer = running.ask("set", "same", settings=("down.delay_ms=40",))
        assert answer.accepted
        assert answer.change == "down.delay_ms 1.0 → 40"
    running.run(1.0)
    assert [a.id for a in running.answers["topside"]] == ["same"] * 3
    assert [a.id for a in running.answers["drone"]] == ["same"] * 3
    assert running.statuses[-1].changes == 1
    assert running.logs == ["link: down.delay_ms 1.0 → 40"]


def test_a_tether_that_starts_again_goes_on_as_it_was_set() -> None:
    running = Running().run(1.0)
    for settings in (("down.delay_ms=300",), ("up.delay_ms=10",)):
        running.ask("set", settings[0], settings=settings)
    running.ask("profile", profile="remote")
    running.ask("down")
    running.ask("up")
    running.ask("set", "last", settings=("down.delay_ms=200",))
    running.host.kill("tether")
    running.host.add("tether", GATEWAY, Stack(link="tether", seed=5))
    running.delays.clear()
    running.run(2.0)
    assert min(running.delays) >= 200 * MS
    assert (running.statuses[-1].profile, running.statuses[-1].changes) == ("remote", 2)


@pytest.mark.parametrize(
    ("kind", "more", "says"),
    [
        ("profile", {"profile": "remotte"}, "did you mean 'remote'"),
        ("profile", {}, "no profile is named"),
        ("set", {"settings": ("down.delay_ms=-1",)}, "down.delay_ms: expected"),
        ("set", {}, "nothing to set"),
    ],
)
def test_a_senseless_request_is_refused_and_changes_nothing(
    kind: str, more: dict[str, Any], says: str
) -> None:
    running = Running().run(1.0)
    answer = running.ask(kind, **more)
    assert not answer.accepted
    assert says in answer.reason
    running.run(1.0)
    assert running.statuses[-1].changes == 0
    assert max(running.delays) < 20 * MS


def test_a_link_that_is_down_carries_nothing_and_says_so_without_old_numbers() -> None:
    running = Running("remote").run(2.0)
    assert running.statuses[-1].up
    assert running.ask("down").accepted
    heard = len(running.delays)
    running.run(2.0)
    status = running.statuses[-1]
    assert len(running.delays) == heard  # neither what entered nor what was on the way
    assert not status.up
    assert status.rtt_ms is None
    assert status.down_link.delay_p50_ms is None
    assert status.down_link.loss == 1.0
    assert status.down_link.lost["outage"] > 100
    assert running.tether.counts["outage:pilot/command"] > 100
    assert running.ask("up").accepted
    running.run(1.0)
    assert running.statuses[-1].up
    assert len(running.delays) > heard


def test_a_damaged_message_is_turned_away_at_the_door_and_never_acted_on(tmp_path: Path) -> None:
    profile = tmp_path / "bad.toml"
    profile.write_text("[down]\ncorrupt = 1.0\n")
    running = Running(str(profile)).run(2.0)
    assert running.delays == []
    arrived = running.tether.counts["damaged:pilot/command"]
    assert arrived > 90
    assert running.drone.counts["malformed:pilot/command"] == arrived


def test_what_befalls_invented_members_is_counted_under_their_family(tmp_path: Path) -> None:
    profile = tmp_path / "bad.toml"
    profile.write_text("[up]\ncorrupt = 1.0\n")
    host = VirtualHost()
    tether = host.add("tether", GATEWAY, Stack(link=str(profile)))
    stranger = host.side("drone")
    for name in [*(f"s{k}" for k in range(100)), "My ROV!"]:
        stranger.forward(Envelope(f"health/{name}", b"\x80", "any"))
    tether.step()
    host.run(100 * MS)
    assert tether.counts["damaged:health/*"] == 100
    assert set(tether.counts) == {"damaged:health/*", "damaged:unknown"}


@pytest.mark.parametrize("sound", [b"\x81\xa1x\x01", b"\x80", b""])
def test_no_decoder_accepts_a_damaged_message(sound: bytes) -> None:
    with pytest.raises(msgspec.DecodeError):
        msgspec.msgpack.decode(damaged(sound))


def test_another_profile_is_in_force_at_once_and_named_in_the_status() -> None:
    running = Running().run(1.0)
    assert max(running.delays) < 20 * MS
    running.delays.clear()
    assert running.ask("profile", profile="remote").accepted
    running.delays.clear()
    running.run(2.0)
    assert min(running.delays[1:]) >= 60 * MS  # the first one was on the way already
    assert running.statuses[-1].profile == "remote"
