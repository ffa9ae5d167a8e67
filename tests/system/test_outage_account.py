"""After an outage the screens, the page, the recording and the summary say the same of what a
person lacked: for how long nothing of the drone arrived."""

import json
from pathlib import Path

import pytest

from messages import topics
from messages.link import LatencyBudget
from services.vehicle_view.view import Newest, vehicle_view
from tools.__main__ import main
from tools.recordings.recording import open_recording

SCRIPT = "t,surge,sway,heave,yaw,event\n0,0,0,0.5,0,\n"
BEGAN_S, S = 4.0, 1e9


@pytest.mark.parametrize(
    ("outages", "link"), [([6.0], "tether"), ([1.5, 0.2, 2.0], "tether"), ([], "tether")]
)
def test_an_outage_is_one_number_everywhere(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], outages: list[float], link: str
) -> None:
    at, rows = BEGAN_S, SCRIPT
    for seconds in outages:
        rows += f"{at},0,0,0,0,link down\n{at + seconds},0,0,0,0,link up\n"
        at += seconds + 4.0
    script = tmp_path / "outages.csv"
    script.write_text(f"{rows}{at},0,0,0,0,\n")
    out = tmp_path / "dive"
    options = ("--pilot", f"script:{script}", "--link", link, "--out", str(out))
    assert main(["simulate", *options]) in (0, 3)
    lost_s = sum(seconds for seconds in outages if seconds > 0.5)  # less is not seen
    said = [
        one.message
        for one in open_recording(out)
        if one.key == topics.LATENCY.key and isinstance(one.message, LatencyBudget)
    ]
    assert said[-1].lost_s == pytest.approx(lost_s, abs=0.1 * len(outages) + 0.001)
    assert json.loads((out / "report.json").read_text())["budget_ms"]["lost_s"] == pytest.approx(
        said[-1].lost_s, abs=0.001
    )
    words = f"the pilot saw nothing of the drone for {said[-1].lost_s:.1f} s"
    assert (words in capsys.readouterr().out) == bool(outages)
    seen = vehicle_view(Newest(latency=said[-1]), said[-1].stamp_ns)
    assert seen.lost_s == round(said[-1].lost_s, 1)
