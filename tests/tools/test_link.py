"""`lindy link`: the model without a network, and requests to a running tether."""

import csv
import io
from pathlib import Path

import msgspec
import pytest

from messages import topics
from messages.link import LinkAnswer, LinkRequest
from services.runtime.config.errors import LindyError
from services.runtime.config.running import Running
from services.runtime.config.stack import Stack
from services.runtime.hosts.stack_file import ServiceSpec
from services.runtime.hosts.virtual_host import VirtualHost
from tools.__main__ import main
from tools.link import link, require_link
from tools.live.asking import OneRequest, at_once

S = 1_000_000_000  # [ns]
Lines = list[dict[str, str]]


def run(capsys: pytest.CaptureFixture[str], *arguments: str) -> Lines:
    status = link(
        list(arguments), exit_on_error=False, print_error=False, result_action="return_value"
    )
    assert status == 0
    return list(csv.DictReader(io.StringIO(capsys.readouterr().out)))


def test_every_message_has_a_line_and_either_an_arrival_or_a_reason(
    capsys: pytest.CaptureFixture[str],
) -> None:
    rows = run(capsys, "--profile", "severe", "--rate", "100", "--seconds", "60", "--seed", "1")
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


def test_the_declared_delay_is_printed_beside_the_measured_one(
    capsys: pytest.CaptureFixture[str],
) -> None:
    arguments = ["--profile", "severe", "--rate", "50", "--seconds", "100", "--seed", "1"]
    link(arguments, exit_on_error=False, print_error=False, result_action="return_value")
    captured = capsys.readouterr()
    rows = list(csv.DictReader(io.StringIO(captured.out)))
    delays = [float(r["arrived_s"]) - float(r["sent_s"]) for r in rows if r["arrived_s"]]
    assert captured.err.startswith("lindy: declared delay: mean 108 ms; measured")
    assert f"mean {1e3 * sum(delays) / len(delays):.0f}, median" in captured.err
    assert f"longest {1e3 * max(delays):.0f} ms" in captured.err
    link(
        ["--profile", "acoustic", "--rate", "25", "--bytes", "10000"], result_action="return_value"
    )
    assert capsys.readouterr().err.endswith("nothing arrived\n")


def test_video_does_not_go_over_sound(capsys: pytest.CaptureFixture[str]) -> None:
    rows = run(capsys, "--profile", "acoustic", "--rate", "25", "--bytes", "10000")
    assert not any(row["arrived_s"] for row in rows)


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["--rate", "0"], "--rate is 0, expected"),
        (["--rate", "nan"], "--rate is nan, expected"),
        (["--seconds", "-1"], "--seconds is -1, expected"),
        (["--rate", "1e9"], "the most is 5e6"),
        (["--seed", "-1"], "--bytes and --seed are whole numbers from 0"),
        (["--profile", "tehter"], "did you mean 'tether'"),
        (["profile", "remote", "--dive", "nowhere"], "no dive is going on in nowhere"),
        (["set", "up.delay_ms=3", "--dive", "nowhere"], "no dive is going on in nowhere"),
        (["down", "--dive", "nowhere"], "no dive is going on in nowhere"),
        (["up", "--dive", "nowhere"], "no dive is going on in nowhere"),
        (["trace", "nowhere.mcap"], "cannot read .*nowhere.mcap"),
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
    assert main(["link", "profile", name]) == 0
    assert (f"lindy: {name} cannot be flown" in capsys.readouterr().err) == warned
