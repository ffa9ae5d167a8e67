"""A recorded dive, read with readers that are not ours, in two languages."""

import json
from collections import Counter
from pathlib import Path
from typing import Any

import pytest
from mcap.reader import make_reader

from services.recorder.foxglove.channel import OFFICIAL, is_view
from tools.__main__ import main
from tools.recordings.recording import open_recording

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


def test_foxglove_s_reader_finds_the_same_and_knows_the_types(dive: Path, foxglove_program: Any):
    found = foxglove_program("read_file.cjs", str(dive / "dive.mcap")).told()
    assert found["counts"] == dict(counted(dive))
    assert found["wrong"] == {}
    without = set(OFFICIAL) - {"foxglove.CompressedVideo"}  # no camera in this dive
    assert found["same"] == dict.fromkeys(without, True)
    assert {"dive.json", "pioneer.toml", "topics.json"} <= set(found["attachments"])
