"""A dive, live and recorded, is shown to clients and readers that are not ours."""

import importlib.util
import json
import socket
import sys
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from mcap.reader import make_reader

from messages import topics
from services.foxglove.service import wire
from services.recorder.foxglove.channel import OFFICIAL, is_view
from services.runtime.bus.envelope import Envelope
from services.runtime.config.errors import LindyError, NeedsRealTimeError
from services.runtime.hosts.virtual_host import VirtualHost
from tests.support.foxglove import SECOND, SIDES, UTC, Watched, stack
from tools.__main__ import main
from tools.recordings.recording import open_recording

needs_sdk = pytest.mark.skipif(
    importlib.util.find_spec("foxglove") is None, reason="the foxglove extra is not installed"
)


@needs_sdk
def test_foxglove_s_client_sees_the_dive_and_can_command_nothing(
    foxglove_program: Callable[..., Any],
):
    watched = Watched()
    client = foxglove_program("watch_live.cjs", str(watched.port))
    while client.runs:
        watched.run_on()
    seen = client.told()
    watched.host.close()
    assert seen["info"]["name"] == "lindy pioneer"
    assert seen["info"]["capabilities"] == []
    assert seen["channels"]["sensor/pressure"] == "PressureSample"
    assert seen["channels"]["foxglove/log"] == "foxglove.Log"
    assert seen["first"]["sensor/pressure"]["pressure"] == 101_325.0
    assert seen["first"]["foxglove/log"]["message"] == "hi"
    stamp = seen["first"]["sensor/pressure"]["stamp_ns"]
    assert int(seen["times"]["sensor/pressure"]) == UTC + stamp
    # What it tried to command.
    assert seen["parameters"] == {}
    assert any("clientPublish" in status for status in seen["statuses"])
    assert any("ervice" in status for status in seen["statuses"]), seen["statuses"]
    assert "pilot/command" not in seen["channels"]
    assert set(watched.node.published) <= {
        topics.HEALTH.of("foxglove"), topics.LOG.of("foxglove")
    }  # fmt: skip


@needs_sdk
def test_garbage_on_the_bus_is_counted_and_shown_to_nobody():
    watched = Watched()
    foreign = watched.host.side("topside")
    foreign.forward(Envelope("who/is/this", b"{}", ""))
    foreign.forward(Envelope("state", b"\xff", topics.STATE.encoding))
    watched.run_on()
    watched.node.wall_offset_ns = -10 * SECOND  # a clock before 1970
    watched.run_on()
    watched.host.close()
    assert watched.node.counts["unknown_key"] == 1
    assert watched.node.counts["malformed:state"] == 1
    assert watched.node.counts["malformed:sensor/pressure"] > 0


@needs_sdk
def test_a_port_that_is_taken_is_one_sentence():
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        with pytest.raises(LindyError, match=rf"cannot listen on 127\.0\.0\.1:{port}.*in use"):
            wire(VirtualHost().node("foxglove", SIDES), stack(f"port={port}"))


@needs_sdk
def test_only_this_machine_is_listened_to_unless_told_and_then_it_is_said():
    quiet = Watched()
    assert [line.level for line in quiet.lines] == ["info"]
    quiet.host.close()
    loud = Watched("host=0.0.0.0")
    assert [line.level for line in loud.lines] == ["info", "warning"]
    loud.host.close()


def test_without_the_sdk_the_sentence_says_what_to_install(monkeypatch: pytest.MonkeyPatch):
    for name in [n for n in sys.modules if n.split(".")[0] == "foxglove"]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.delitem(sys.modules, "services.foxglove.io.server", raising=False)
    monkeypatch.setitem(sys.modules, "foxglove", None)
    with pytest.raises(LindyError, match=r"foxglove-sdk, which is not installed.*--extra foxglove"):
        wire(VirtualHost().node("foxglove", SIDES), stack())


def test_on_virtual_time_nobody_can_watch():
    with pytest.raises(NeedsRealTimeError):
        wire(VirtualHost().node("foxglove", SIDES), stack(virtual=True))


# A recorded dive, read with readers that are not ours, in two languages.


SCRIPT = "t,surge,sway,heave,yaw\n0,0,0,0,0\n0.5,0.5,0,0.5,0\n2,0,0,0,0\n"


@pytest.fixture(scope="module")
def dive(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("dives")
    script = folder / "sticks.csv"
    script.write_text(SCRIPT)
    words = ["simulate", "--pilot", f"script:{script}", "--seconds", "4", "--out"]
    quick = ["--set", "estimation.calibration.still_time=3"]
    assert main([*words, str(folder / "dive"), *quick]) == 0
    return folder / "dive"


def counted(dive: Path) -> Counter[str]:
    """Messages by key, as the mcap library for Python reads them."""
    with (dive / "dive.mcap").open("rb") as stream:
        return Counter(channel.topic for _, channel, _ in make_reader(stream).iter_messages())


@pytest.mark.slow
def test_views_are_beside_the_messages_and_are_not_taken_for_messages(dive: Path):
    counts = counted(dive)
    ours = Counter(raw.key for raw in open_recording(dive).raw())
    assert ours == Counter({key: n for key, n in counts.items() if not is_view(key)})
    for key in ("control/thrusters", "control/wrench", "vehicle/actuation", "sensor/imu"):
        assert counts[f"foxglove/plot/{key}"] == pytest.approx(counts[key] / 4, rel=0.02)
    assert counts["foxglove/transforms"] == counts["foxglove/pose"] > 100
    assert counts["foxglove/log"] == sum(n for k, n in counts.items() if k.startswith("log/"))
    losses = json.loads((dive / "report.json").read_text())["losses"]
    assert not any(name.startswith(("unreadable", "unknown")) for name in losses)


def test_foxglove_s_reader_finds_the_same_and_knows_the_types(
    foxglove_program: Any, request: pytest.FixtureRequest
):
    dive: Path = request.getfixturevalue("dive")  # flown for who has the reader
    found = foxglove_program("read_file.cjs", str(dive / "dive.mcap")).told()
    assert found["counts"] == dict(counted(dive))
    assert found["wrong"] == {}
    without = set(OFFICIAL) - {"foxglove.CompressedVideo"}  # no camera in this dive
    assert found["same"] == dict.fromkeys(without, True)
    assert {"dive.json", "pioneer.toml", "topics.json"} <= set(found["attachments"])
