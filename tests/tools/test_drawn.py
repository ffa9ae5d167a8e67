"""A recording without the visualizer's becomes one that shows the same."""

from pathlib import Path

import pytest

pytest.importorskip("rerun", reason="the viewer extra is not installed")

from tests.services.visualizer.test_visualizer_service import read_back
from tests.tools.importing.logs import SLOW_HZ, ulog
from tests.tools.importing.test_rosbags import imported
from tools.picture import draw
from tools.replay.source import open_source


@pytest.mark.filterwarnings("ignore:RRD file has no footer")
def test_an_imported_recording_is_drawn(tmp_path: Path) -> None:
    out = imported(ulog(tmp_path / "1.ulg"), tmp_path / "dive")
    before = sorted(path.name for path in out.iterdir())
    draw(open_source(out), tmp_path / "dive.rrd")
    times, depths = read_back(tmp_path / "dive.rrd", "/depth/autopilot")
    assert depths == pytest.approx([k / SLOW_HZ for k in range(2 * SLOW_HZ)])
    assert times == pytest.approx(depths)  # it sinks by 1 m/s
    assert sorted(path.name for path in out.iterdir()) == before
