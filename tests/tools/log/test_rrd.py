from pathlib import Path

import numpy as np
import pytest

from services.marine.vehicle import Vehicle
from services.runtime.config.stack import Stack
from tools.__main__ import main

rr = pytest.importorskip("rerun", reason="the viewer extra is not installed")

from services.visualizer.blueprint import blueprint  # noqa: E402 - needs rerun
from tests.services.visualizer.test_visualizer_service import read_back  # noqa: E402
from tests.support.docs.viewer_picture import needs_vulkan, picture  # noqa: E402
from tests.tools.importing.logs import SLOW_HZ, ulog  # noqa: E402
from tests.tools.importing.test_rosbags import imported  # noqa: E402

PNG = b"\x89PNG\r\n\x1a\n"

PAGES = ("motion", "control", "sensors", "link", "camera", "health")  # behind the first one


def recording(path: Path, *, laid_out: bool = False) -> Path:
    """Three seconds of a rising line; with the visualizer's pages, if wanted."""
    stream = rr.RecordingStream("lindy", recording_id=path.stem)
    stream.save(path)
    if laid_out:
        stream.send_blueprint(blueprint(Stack(vehicle="pioneer").section("vehicle", Vehicle)))
    times = np.array([0, 1_000_000_000, 3_000_000_000], dtype="timedelta64[ns]")
    stream.send_columns(
        "depth",
        indexes=[rr.TimeColumn("dive", duration=times)],
        columns=rr.Scalars.columns(scalars=[0.0, 1.0, 3.0]),
    )
    stream.flush()
    stream.disconnect()
    return path


@pytest.mark.slow
@needs_vulkan
def test_the_viewer_shows_a_dive_and_each_of_its_pages(tmp_path: Path) -> None:
    rrd = recording(tmp_path / "dive.rrd", laid_out=True)
    pictures = {page: picture(rrd, 1.5, page) for page in (None, *PAGES)}
    assert len({*pictures.values()}) == len(pictures)
    first = pictures[None]
    assert first.startswith(PNG)
    assert (int.from_bytes(first[16:20], "big"), int.from_bytes(first[20:24], "big")) == (1600, 900)


@pytest.mark.parametrize("room", [0, 1])
def test_on_a_full_disk_it_is_one_sentence_and_there_is_no_file(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, room: int
) -> None:
    """At its beginning, and later."""
    out, rrd = imported(ulog(tmp_path / "1.ulg"), tmp_path / "dive"), tmp_path / "dive.rrd"
    written: list[int] = []

    def require_room(_: Path, size: int) -> None:
        if len(written) == room:
            raise OSError(28, "No space left on device")
        written.append(size)

    monkeypatch.setattr("services.visualizer.io.rrd_file.require_room", require_room)
    capsys.readouterr()
    assert main(["log", "export", "--as", "rrd", str(out), "--out", str(rrd)]) == 1
    assert capsys.readouterr().err == (
        f"lindy: cannot write {rrd}: the disk is full; make room there, or name a place on another "
        f"disk by --out\n"
    )
    assert not rrd.exists()


@pytest.mark.filterwarnings("ignore:RRD file has no footer")
def test_an_imported_recording_is_drawn(tmp_path: Path) -> None:
    out = imported(ulog(tmp_path / "1.ulg"), tmp_path / "dive")
    before = sorted(path.name for path in out.iterdir())
    rrd = tmp_path / "dive.rrd"
    assert main(["log", "export", "--as", "rrd", str(out), "--out", str(rrd)]) == 0
    times, depths = read_back(rrd, "/depth/autopilot")
    assert depths == pytest.approx([k / SLOW_HZ for k in range(2 * SLOW_HZ)])
    assert times == pytest.approx(depths)  # it sinks by 1 m/s
    assert sorted(path.name for path in out.iterdir()) == before
