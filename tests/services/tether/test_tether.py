"""The tether: late by what its profile says, in order, byte for byte, and nothing else."""

from pathlib import Path
from typing import Any

import msgspec
import pytest

from messages import topics
from messages.link import LinkAnswer, LinkRequest, LinkStatus
from messages.topic import Direction
from services.runtime.bus.envelope import Envelope
from services.runtime.config.errors import LindyError
from services.runtime.config.settings import DEPLOY
from services.runtime.config.stack import Stack
from services.runtime.hosts.stack_file import ServiceSpec
from services.runtime.hosts.virtual_host import VirtualHost
from services.tether.io.profile_file import adjusted, named
from services.tether.profile import Trace
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


# Profile files: those that are shipped are whole, and a mistake is told in one sentence.


PROFILES = sorted(path.stem for path in (DEPLOY / "links").glob("*.toml"))


@pytest.mark.parametrize("name", PROFILES)
def test_a_shipped_profile_says_what_it_is_and_where_its_numbers_come_from(name: str) -> None:
    assert named(name).profile.about
    text = (DEPLOY / "links" / f"{name}.toml").read_text(encoding="utf-8")
    assert "=" not in text.partition("\n")[2] or "\n# " in text


def write(folder: Path, text: str) -> str:
    path = folder / "mine.toml"
    path.write_text(text, encoding="utf-8")
    return str(path)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (
            "[up]\ndelay_ms = -1.0",
            r"mine\.toml:2: up\.delay_ms: expected a number >= 0.0 ms, found -1",
        ),
        ("[up]\nloss = { los_good = 0.1 }", "did you mean 'loss_good'"),
        ("[up]\ndelay = { kind = 'paretto', mean_ms = 1.0 }", "did you mean 'pareto'"),
        ("[up]\ndelay = { mean_ms = 1.0 }", "up.delay.kind: unknown kind None"),
        (
            "[up]\ndelay = { kind = 'pareto', mean_ms = 5.0, shape = 1.0 }",
            "shape: expected a number",
        ),
        (
            "[up]\njitter_ms = 1.0\ndelay = { kind = 'table', ms = [1, 2] }",
            "jitter_ms or delay, not both",
        ),
        ("[up]\nqueue = { limit_bytes = 1000 }", "a queue needs rate_kbit above 0"),
        ("[up]\nrat_kbit = 9.0", "up.rat_kbit: unknown key; did you mean 'rate_kbit'"),
        (
            "[up.outages]\nwindows = [{start_s = 1.0, seconds = 2.0},"
            " {start_s = 2.0, seconds = 1.0}]",
            "windows overlap: the outage at 2 s begins before the one at 1 s ends",
        ),
        (
            "[up.outages]\nrepeat_s = 2.0\nwindows = [{start_s = 1.0, seconds = 2.0}]",
            "repeat_s is 2, expected at least the end of the last outage, 3",
        ),
        (
            "[up]\nloss = { to_bad = 0.1, to_good = 0.0 }",
            "the link would stay bad for ever",
        ),
        ("[up]\ndelay = { kind = 'trace' }", "a trace needs a file"),
        (
            "[up]\ndelay = { kind = 'trace', file = 'no.csv' }",
            r"cannot read .*no\.csv: No such file",
        ),
    ],
)
def test_a_mistake_is_named_with_its_place(tmp_path: Path, text: str, says: str) -> None:
    with pytest.raises(LindyError, match=says):
        named(write(tmp_path, text))


def test_a_trace_is_read_from_beside_its_profile(tmp_path: Path) -> None:
    (tmp_path / "t.csv").write_text("# how\nsent_s,arrived_s\n0,60\n1,\n2,2\n")
    found = named(write(tmp_path, "[up]\ndelay = { kind = 'trace', file = 't.csv' }"))
    delay = found.profile.up.delay
    assert isinstance(delay, Trace)
    assert delay.sent_s == (0.0, 1.0, 2.0)
    assert delay.arrived_s == (60.0, None, 2.0)  # a minute at most, and none at least
    after, _ = adjusted(found, ["up.delay_ms=3"])  # the folder is still known
    assert after.profile.up.delay == delay


@pytest.mark.parametrize(
    ("rows", "says"),
    [
        ("0,0.1\n0,0.2\n", "expected ascending times"),
        ("0,0.1\n1,0.5\n", "expected 0 to 60 s later"),
        ("0,0.1,7\n", r"t\.csv:1: expected sent_s,arrived_s"),
        ("0,nan\n", "expected 0 to 60 s later"),
        ("0,60.1\n", "expected 0 to 60 s later"),
        ("", "holds no rows"),
    ],
)
def test_a_mistake_in_a_trace_is_told_of_that_file(tmp_path: Path, rows: str, says: str) -> None:
    (tmp_path / "t.csv").write_text(rows)
    with pytest.raises(LindyError, match=says) as caught:
        named(write(tmp_path, "[up]\ndelay = { kind = 'trace', file = 't.csv' }"))
    assert "t.csv" in str(caught.value)


def test_settings_change_single_keys_and_say_what_has_changed() -> None:
    before = named("tether")
    after, words = adjusted(before, ["up.delay_ms=80", "down.rate_kbit=256"])
    assert after.profile.up.delay_ms == 80.0
    assert after.profile.up.jitter_ms == before.profile.up.jitter_ms
    assert words == "up.delay_ms 1.0 → 80, down.rate_kbit unset → 256"
    assert before.profile.up.delay_ms == 1.0
