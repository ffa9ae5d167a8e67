"""Whatever is lost on the way, what was sent is recorded, accounted for or named as missing."""

from collections import Counter
from pathlib import Path

import msgspec
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.writer import Writer

from messages.health import Health
from services.recorder.foxglove.channel import is_view
from tests.support import said
from tests.support.recorded import ShortDive, rewritten
from tools.__main__ import main
from tools.log.check import Accounts, LinkReports, Numbering, account_for, accounts
from tools.recordings.mcap_records import Raw
from tools.recordings.recording import open_recording

KEY = "pilot/command"
numbers = st.integers(0, 300)


def numbered(fates: list[str]) -> Numbering:
    """Messages sent every 10 ms; lost, arrived, twice, or one behind the next."""
    arrivals: list[tuple[int, int]] = []
    for number, fate in enumerate(fates):
        at = 10 * number
        if fate != "lost":
            arrivals.append((at + (15 if fate == "late" else 0), number))
        if fate == "twice":
            arrivals.append((at + 4, number))
    found = Numbering()
    for at, number in sorted(arrivals):
        found.see(number, 10 * number, at)
    return found


@given(st.lists(st.sampled_from(["lost", "here", "here", "twice", "late"]), min_size=1))
def test_numbers_tell_what_is_missing_twice_or_late(fates: list[str]) -> None:
    there = [n for n, fate in enumerate(fates) if fate != "lost"]
    if not there:
        return
    found = numbered(["here", *fates, "here"])
    assert found.sent == len(fates) + 2
    assert found.missing == fates.count("lost")
    assert found.recorded == len(there) + 2
    assert found.duplicated == fates.count("twice")


@given(st.lists(st.integers(1, 60), min_size=1, max_size=5))
def test_a_sender_that_starts_again_has_lost_nothing(lives: list[int]) -> None:
    found, at = Numbering(), 0
    for life in lives:
        for number in range(life):
            at += 10
            found.see(number, at, at)
    assert (found.sent, found.missing, found.duplicated) == (sum(lives), 0, 0)


@given(numbers.filter(lambda n: n > 0), numbers)
def test_two_senders_of_one_topic_are_told_apart(ahead: int, count: int) -> None:
    found = Numbering()
    for n in range(count):
        found.see(1000 + ahead + n, 10 * n, 10 * n)
        found.see(n, 10 * n + 5, 10 * n + 5)
    assert (found.sent, found.missing) == (2 * count, 0)


def test_a_recording_that_begins_late_has_lost_nothing() -> None:
    found = Numbering()
    for n in range(50, 60):
        found.see(n, n, n)
    assert (found.before, found.sent, found.missing) == (50, 10, 0)


def health(service: str, seq: int, counts: dict[str, int]) -> Health:
    return said.health(service, seq=seq, stamp_ns=seq, sent=seq, counts=counts)


@given(
    st.lists(st.booleans(), min_size=2, max_size=80),
    *(st.integers(0, 100) for _ in range(5)),
)
def test_the_parts_are_the_whole_whatever_was_counted(
    arrived: list[bool], loss: int, thinned: int, full: int, malformed: int, unwritten: int
) -> None:
    numbering = numbered(["here" if here else "lost" for here in arrived] + ["here"])
    reports = LinkReports()
    counts = {f"loss:{KEY}": loss, f"thinned:{KEY}": thinned, f"queue_full:{KEY}": full}
    reports.add(health("tether", 0, counts), 10**6)
    counted = Counter({f"malformed:{KEY}": malformed, "not_recorded": unwritten})
    account = account_for({KEY: numbering}, reports, counted, "drone")[KEY]
    lost = (account.link, account.thinned, account.queue, account.refused, account.recorder)
    assert account.sent == account.recorded + sum(lost) + account.unreported + account.missing
    most = (loss, thinned, full, malformed, unwritten)
    assert all(0 <= part <= limit for part, limit in zip(lost, most, strict=True))
    if sum(most) >= numbering.missing:
        assert account.missing == 0


@pytest.mark.parametrize(("side", "missing"), [("drone", 5), ("topside", 0)])
def test_what_does_not_cross_the_link_is_not_lost_on_it(side: str, missing: int) -> None:
    numbering = numbered(["here", *["lost"] * 5, "here"])
    reports = LinkReports()
    reports.add(health("tether", 0, {"loss:state": 9}), 10**6)
    account = account_for({"state": numbering}, reports, Counter(), side)["state"]
    assert account.missing == missing


def test_a_real_link_counts_nothing_but_its_receivers_do() -> None:
    numbering = numbered(["here", *["lost"] * 5, "here"])
    reports = LinkReports()
    counts = {f"lost:{KEY}": 4, f"expired:{KEY}": 1}
    reports.add(health("reference", 0, counts), 10**6)
    account = account_for({KEY: numbering}, reports, Counter(), "drone")[KEY]
    assert (account.link, account.missing) == (3, 2)


def test_what_was_lost_before_the_recording_began_is_not_counted_for_what_is_lost_in_it() -> None:
    numbering = numbered(["here", *["lost"] * 5, "here"])
    reports = LinkReports()
    for seq, lost in ((7, 100), (8, 102)):
        counts = {f"loss:{KEY}": lost}
        reports.add(health("tether", seq, counts), 10 * seq - 70)
    account = account_for({KEY: numbering}, reports, Counter(), "drone")[KEY]
    assert account.link == 2


def test_a_dive_over_a_bad_link_is_accounted_for(dive: ShortDive) -> None:
    found = accounts(open_recording(dive.folder))
    command = found.topics[KEY]
    assert command.link > 10
    assert command.refused > 0  # damaged on the link
    assert command.duplicated > 0
    assert found.missing == 0
    assert found.topics["sensor/imu"].sent == found.topics["sensor/imu"].recorded


def without(dive: ShortDive, out: Path, dropped: set[int]) -> Path:
    """A copy without the messages that have these places among those of the bus in the file."""
    place = 0

    def kept(key: str, message: Raw) -> Raw | None:
        nonlocal place
        place += not is_view(key)
        return message if is_view(key) or place not in dropped else None

    return rewritten(dive, out, kept)


@given(st.sets(st.integers(2000, 2500), min_size=1, max_size=20))
@settings(max_examples=5)
def test_any_message_that_is_left_out_is_missed(
    dive: ShortDive, tmp_path_factory: pytest.TempPathFactory, dropped: set[int]
) -> None:
    out = tmp_path_factory.mktemp("less") / "dive.mcap"
    less, whole = (
        accounts(open_recording(path)) for path in (without(dive, out, dropped), dive.folder)
    )

    def absent(found: Accounts) -> int:
        """Also a message of a topic with no other behind it, which no number tells of."""
        return sum(a.missing + a.unreported + a.link + a.refused for a in found.topics.values())

    recorded = sum(a.recorded + a.duplicated for a in less.topics.values())
    assert recorded == sum(a.recorded + a.duplicated for a in whole.topics.values()) - len(dropped)
    assert absent(less) >= absent(whole)
    assert less.missing > 0


def test_the_verb_says_3_and_which_messages(
    dive: ShortDive, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["log", "check", str(dive.folder)]) == 0
    assert "everything that was sent is accounted for" in capsys.readouterr().out
    path = without(dive, tmp_path / "dive.mcap", set(range(2000, 2100)))
    assert main(["log", "check", str(path), "--json"]) == 3
    found = msgspec.json.decode(capsys.readouterr().out)
    assert not found["ok"]
    assert any("sensor/imu: " in line for line in found["wrong"])


def test_a_recording_without_an_end_is_not_whole(
    dive: ShortDive, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "dive.mcap"
    data = (dive.folder / "dive.mcap").read_bytes()
    path.write_bytes(data[: len(data) // 2])
    assert main(["log", "check", str(path)]) == 3
    assert "dive.mcap was not finished" in capsys.readouterr().out


def test_a_clock_that_runs_backwards_is_said(
    dive: ShortDive, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    back = 0

    def set_back(_: str, message: Raw) -> Raw:
        nonlocal back
        back = 3_000_000_000 if message.log_ns > 3_500_000_000 else back
        return message._replace(log_ns=message.log_ns - back)

    path = rewritten(dive, tmp_path / "dive.mcap", set_back)
    assert main(["log", "check", str(path)]) == 0
    assert "the recorder's clock ran backwards once" in capsys.readouterr().out


def test_a_recording_of_another_program_is_one_sentence(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "other.mcap"
    with path.open("wb") as stream:
        writer = Writer(stream)
        writer.start()
        writer.add_message(writer.register_channel("/chatter", "ros1", 0), 0, b"said", 0)
        writer.finish()
    assert main(["log", "check", str(path)]) == 1
    assert "was not recorded by Lindy" in capsys.readouterr().err
