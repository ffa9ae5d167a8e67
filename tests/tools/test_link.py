"""`lindy link`: the model without a network, requests to a running tether, links that cannot be
flown, and traces of recordings."""

import csv
import io
from pathlib import Path

import msgspec
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from messages import topics
from messages.link import LinkAnswer, LinkRequest
from messages.message import Message
from messages.pilot import TTL_MS, PilotCommand
from services.recorder.io.mcap_file import McapFile
from services.runtime.config.errors import LindyError
from services.runtime.config.running import Running
from services.runtime.config.stack import Stack
from services.runtime.hosts.stack_file import ServiceSpec
from services.runtime.hosts.virtual_host import VirtualHost
from services.tether.io.profile_file import named
from services.tether.link_model import LinkDirection, fates
from services.tether.profile import Delay, DirectionProfile, Pareto, Table
from tools.__main__ import main
from tools.ask import OneRequest, at_once
from tools.link import link, require_link
from tools.link_fit import COMMAND_BYTES, flyable, profiles, shortest_ms
from tools.log.sticks import trace_of

S = 1_000_000_000  # [ns]
Lines = list[dict[str, str]]


def run(capsys: pytest.CaptureFixture[str], *arguments: str) -> Lines:
    status = link(
        ["show", *arguments], exit_on_error=False, print_error=False, result_action="return_value"
    )
    assert status == 0
    return list(csv.DictReader(io.StringIO(capsys.readouterr().out)))


def test_every_message_has_a_line_and_either_an_arrival_or_a_reason(
    capsys: pytest.CaptureFixture[str],
) -> None:
    rows = run(capsys, "severe", "--hz", "100", "--seconds", "60", "--seed", "1")
    assert list(rows[0]) == ["seq", "sent_s", "arrived_s", "reason"]
    assert {int(row["seq"]) for row in rows} == set(range(6000))
    assert [int(row["seq"]) for row in rows] == sorted(int(row["seq"]) for row in rows)
    for row in rows:
        assert float(row["sent_s"]) == pytest.approx(int(row["seq"]) / 100.0)
        if row["arrived_s"]:
            assert float(row["arrived_s"]) >= float(row["sent_s"]) + 0.08
            assert row["reason"] in ("", "damaged")
        else:
            assert row["reason"] in ("loss", "burst", "queue_full")


def test_video_does_not_go_over_sound(capsys: pytest.CaptureFixture[str]) -> None:
    rows = run(capsys, "acoustic", "--hz", "25", "--bytes", "10000")
    assert not any(row["arrived_s"] for row in rows)


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["show", "--hz", "0"], "--hz is 0, expected"),
        (["show", "--hz", "nan"], "--hz is nan, expected"),
        (["show", "--seconds", "-1"], "--seconds is -1, expected"),
        (["show", "--hz", "1e9"], "the most is 5e6"),
        (["show", "--seed", "-1"], "--bytes and --seed are whole numbers from 0"),
        (["show", "tehter"], "did you mean 'tether'"),
        (["set", "remote", "--dive", "nowhere"], "no dive is going on in nowhere"),
        (["set", "up.delay_ms=3", "--dive", "nowhere"], "no dive is going on in nowhere"),
        (["set", "down", "--dive", "nowhere"], "no dive is going on in nowhere"),
        (["set", "up", "--dive", "nowhere"], "no dive is going on in nowhere"),
    ],
)
def test_a_wrong_argument_is_explained(arguments: list[str], says: str) -> None:
    with pytest.raises(LindyError, match=says):
        link(arguments, exit_on_error=False, print_error=False, result_action="return_value")


def ask(host: VirtualHost, request: LinkRequest) -> OneRequest[LinkRequest, LinkAnswer]:
    node = host.node("link", ["topside"])
    return at_once(node, request, topics.LINK_REQUEST, topics.LINK_ANSWER)


def test_a_running_tether_answers_whoever_asks(tmp_path: Path) -> None:
    host = VirtualHost()
    row = ServiceSpec(sides=["topside", "drone"], gateway=True)
    host.add("tether", row, Stack(link="tether", out=str(tmp_path)))
    request = LinkRequest(stamp_ns=0, id="", kind="set", settings=("up.delay_ms=9",))
    asking = ask(host, request)
    host.run(10 * S, lambda: asking.answer is not None)
    assert asking.answer is not None
    assert asking.answer.accepted
    assert asking.answer.change == "up.delay_ms 1.0 → 9"


@pytest.mark.parametrize(
    ("side", "says"),
    [
        ("topside", "this dive has no emulated link; start the topside with --gateway"),
        ("drone", "the drone's side has no emulated link; ask in the topside's folder"),
    ],
)
def test_a_side_without_an_emulated_link_says_so(side: str, says: str) -> None:
    running = Running("pioneer", {side: "unixsock-stream/x"}, 1, {f"hub_{side}": 2})
    with pytest.raises(LindyError, match=says):
        require_link(running)
    require_link(msgspec.structs.replace(running, pids={f"hub_{side}": 2, "tether": 3}))


@pytest.mark.parametrize(("name", "warned"), [("acoustic", True), ("remote", False)])
def test_a_profile_that_cannot_be_flown_is_taken_with_a_warning(
    name: str, warned: bool, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def accepted(request: LinkRequest, _: object) -> int:
        assert request.profile == name
        return 0

    monkeypatch.setattr("tools.link._ask", accepted)
    assert main(["link", "set", name]) == 0
    assert (f"loses its pilot by it: {name} cannot be flown" in capsys.readouterr().err) == warned


DELAY_MS = st.floats(0.0, 500.0)


def table(delays: list[float]) -> Table:
    return Table(ms=tuple(delays))


DELAYS: st.SearchStrategy[Delay | None] = st.one_of(
    st.none(),
    st.builds(Pareto, mean_ms=DELAY_MS),
    st.builds(table, st.lists(DELAY_MS, min_size=2, max_size=5)),
)
LEGS = st.builds(
    DirectionProfile, delay_ms=DELAY_MS, delay=DELAYS, rate_kbit=st.sampled_from([0.0, 5.0, 500.0]),
    overhead_bytes=st.integers(0, 200),
)  # fmt: skip


@given(LEGS, st.integers(0, 1000))
def test_no_command_is_ever_faster_than_the_shortest_delay(leg: DirectionProfile, seed: int):
    line: LinkDirection[int] = LinkDirection(leg, np.random.default_rng(seed))
    for second in range(5):
        entered = second * 10_000_000_000
        line.enter(second, entered, COMMAND_BYTES)
        before = entered + round(1e6 * shortest_ms(leg)) - 2
        assert line.leave(before) is None
        while line.leave(entered + 9_999_999_999) is not None:
            pass


def test_all_profiles_but_the_acoustic_one_can_be_flown():
    assert set(profiles()) - set(flyable()) == {"acoustic"}


def test_the_shortest_delay_of_a_trace_is_that_of_its_fastest_message(tmp_path: Path):
    (tmp_path / "trace.csv").write_text("sent_s,arrived_s\n0,0.5\n1,1.42\n2,\n")
    profile = tmp_path / "mine.toml"
    profile.write_text('[down]\ndelay = { kind = "trace", file = "trace.csv" }\n')
    assert shortest_ms(named(str(profile)).profile.down) == pytest.approx(420.0)


@pytest.mark.parametrize("verb", ["dive", "simulate"])
def test_a_link_that_cannot_be_flown_is_refused_at_once_with_those_that_can(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], verb: str
):
    out = tmp_path / "dive"
    assert main([verb, "--pilot", "script:first_dive", "--link", "acoustic", "--out", str(out)])
    sentence = capsys.readouterr().err
    ms = shortest_ms(named("acoustic").profile.down)
    for words in (f"{ms:.0f} ms", f"{TTL_MS:g} ms", "tether, wifi_buoy", "satellite", "never arm"):
        assert words in sentence
    assert not out.exists()


MS = 1_000_000  # [ns]
UTC = 1_700_000_000_000_000_000  # [ns]
Said = list[tuple[str, Message, int]]  # key, message, delay until it is recorded [ns]


def write(path: Path, said: Said) -> None:
    file = McapFile(path)
    file.open_channel(topics.PILOT_COMMAND.key, "PilotCommand", b"{}")
    for key, message, delay in said:
        sent = UTC + message.stamp_ns
        file.write(key, msgspec.json.encode(message), sent + delay, sent, message.seq)
    file.finish()


def command(seq: int, delay_ms: float) -> tuple[str, Message, int]:
    message = PilotCommand(seq=seq, stamp_ns=seq * 20 * MS, surge=0.0, sway=0.0, heave=0.0, yaw=0.0)
    return topics.PILOT_COMMAND.key, message, round(delay_ms * MS)


def test_delays_and_losses_of_commands_are_found_and_replayed_exactly(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    random = np.random.default_rng(1)
    delays = {
        seq: float(random.uniform(5.0, 19.0)) for seq in range(100) if seq not in (10, 40, 41)
    }
    write(tmp_path / "dive.mcap", [command(seq, delay) for seq, delay in delays.items()])
    out = tmp_path / "trace.csv"
    assert main(["log", "export", "--as", "trace", str(tmp_path), "--out", str(out)]) == 0
    assert "100 messages, 3 lost; one way, down" in capsys.readouterr().out
    assert out.read_text().startswith("# one way, down: arrival of pilot/command on board")

    profile = tmp_path / "mine.toml"
    profile.write_text("[down]\ndelay = { kind = 'trace', file = 'trace.csv' }\n")
    rows = fates(named(str(profile)).profile.down, 50.0, 200, 1.98, 0)
    for seq, sent, arrived, reason in rows:
        if seq in delays:
            assert arrived is not None
            assert 1e3 * (arrived - sent) == pytest.approx(delays[seq], abs=2e-3)
        else:
            assert (arrived, reason) == (None, "trace")


def test_a_command_whose_stamp_the_recorder_did_not_know_tells_no_delay(tmp_path: Path) -> None:
    write(tmp_path / "dive.mcap", [command(seq, 0.0 if seq < 5 else 8.0) for seq in range(9)])
    assert [arrived - sent for sent, arrived in trace_of(tmp_path) if arrived] == (
        pytest.approx([8e-3] * 4)
    )


def test_a_command_recorded_twice_counts_once_and_a_restart_is_no_loss(tmp_path: Path) -> None:
    said = [command(seq, 8.0) for seq in (0, 1, 1, 2)]
    later = [
        (key, msgspec.structs.replace(message, seq=message.seq - 50), delay)
        for key, message, delay in (command(seq, 8.0) for seq in (50, 51))
    ]
    write(tmp_path / "dive.mcap", said + later)
    rows = trace_of(tmp_path)
    assert len(rows) == 5
    assert all(arrived is not None for _, arrived in rows)


@pytest.mark.parametrize(
    ("said", "says"),
    [
        ([], "holds no pilot commands"),
        ([command(0, -6.0), command(1, 5.0)], "the clocks of both ends differ"),
        ([command(0, 5.0), command(1, 70_000.0)], "the clocks of both ends differ"),
    ],
)
def test_what_cannot_be_told_is_refused(tmp_path: Path, said: Said, says: str) -> None:
    write(tmp_path / "dive.mcap", said)
    with pytest.raises(LindyError, match=says):
        trace_of(tmp_path)
