"""`lindy log export --as trace`: delays and losses of a recording, replayed by the model."""

from pathlib import Path

import msgspec
import numpy as np
import pytest

from messages import topics
from messages.link import Clock
from messages.message import Message
from messages.pilot import PilotCommand
from services.recorder.io.mcap_file import McapFile
from services.runtime.config.errors import LindyError
from services.tether.io.profile_file import named
from services.tether.link_model import fates
from tools.__main__ import main
from tools.log.link_trace import trace_of

MS = 1_000_000  # [ns]
UTC = 1_700_000_000_000_000_000  # [ns]
Said = list[tuple[str, Message, int]]  # key, message, delay until it is recorded [ns]


def write(path: Path, said: Said) -> None:
    file = McapFile(path)
    for key, kind in ((topics.PILOT_COMMAND.key, "PilotCommand"), (topics.CLOCK.key, "Clock")):
        file.open_channel(key, kind, b"{}")
    for key, message, delay in said:
        sent = UTC + message.stamp_ns
        file.write(key, msgspec.json.encode(message), sent + delay, sent, message.seq)
    file.finish()


def command(seq: int, delay_ms: float) -> tuple[str, Message, int]:
    message = PilotCommand(seq=seq, stamp_ns=seq * 20 * MS, surge=0.0, sway=0.0, heave=0.0, yaw=0.0)
    return topics.PILOT_COMMAND.key, message, round(delay_ms * MS)


def clock(n: int, offset_ms: float, rtt_ms: float | None) -> tuple[str, Message, int]:
    message = Clock(
        seq=n, stamp_ns=n * 200 * MS, offset_ns=round(offset_ms * MS), bound_ns=MS, drift_ppm=0.0,
        rtt_ms=rtt_ms, rtt_min_ms=rtt_ms, answered_ms=0.0,
    )  # fmt: skip
    return topics.CLOCK.key, message, 5 * MS


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
    assert [arrived - sent for sent, arrived in trace_of(tmp_path).rows if arrived] == (
        pytest.approx([8e-3] * 4)
    )


def test_a_command_recorded_twice_counts_once_and_a_restart_is_no_loss(tmp_path: Path) -> None:
    said = [command(seq, 8.0) for seq in (0, 1, 1, 2)]
    later = [
        (key, msgspec.structs.replace(message, seq=message.seq - 50), delay)
        for key, message, delay in (command(seq, 8.0) for seq in (50, 51))
    ]
    write(tmp_path / "dive.mcap", said + later)
    rows = trace_of(tmp_path).rows
    assert len(rows) == 5
    assert all(arrived is not None for _, arrived in rows)


def test_where_clocks_differ_half_of_each_round_trip_counts(tmp_path: Path) -> None:
    clocks = [clock(n, 5000.0, 30.0 + n if n != 3 else None) for n in range(10)]
    write(tmp_path / "dive.mcap", [command(n, 5010.0) for n in range(100)] + clocks)
    found = trace_of(tmp_path)
    assert found.remarks == [
        "half of each round trip of clock/ping, so the same in both directions",
        "the clocks of both ends differ",
    ]
    assert found.rows[3][1] is None
    for n, (sent, arrived) in enumerate(found.rows):
        assert sent == pytest.approx(0.2 * n)
        if arrived is not None:
            assert arrived - sent == pytest.approx((30.0 + n) / 2e3)


def test_clocks_that_are_known_to_agree_let_commands_count(tmp_path: Path) -> None:
    said = [command(n, 10.0) for n in range(50)] + [clock(n, 0.2, 20.0) for n in range(5)]
    write(tmp_path / "dive.mcap", said)
    found = trace_of(tmp_path)
    assert found.remarks[1] == "the clocks of both ends are known to be one"
    assert len(found.rows) == 50


@pytest.mark.parametrize(
    ("said", "says"),
    [
        ([], "neither pilot commands on one clock nor clock round trips"),
        ([command(0, -5.0), command(1, 5.0)], "the clocks of both ends differ"),
        ([command(0, 5.0), command(1, 70_000.0)], "the clocks of both ends differ"),
    ],
)
def test_what_cannot_be_told_is_refused(tmp_path: Path, said: Said, says: str) -> None:
    write(tmp_path / "dive.mcap", said)
    with pytest.raises(LindyError, match=says):
        trace_of(tmp_path)
