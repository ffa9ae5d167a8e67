from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from services.marine.vehicle import Vehicle
from services.runtime.config.errors import LindyError
from services.runtime.config.stack import Stack
from tools.importing.command import import_log
from tools.picture import IDLE_S, draw, loaded, picture, rrd_of
from tools.replay.source import open_source

rr = pytest.importorskip("rerun", reason="the viewer extra is not installed")

from services.visualizer.blueprint import PAGES, blueprint  # noqa: E402 - needs rerun
from tests.tools.importing.logs import SLOW_HZ, ulog  # noqa: E402

DRIVERS = [Path("/usr/share/vulkan/icd.d"), Path("/etc/vulkan/icd.d")]
needs_vulkan = pytest.mark.skipif(
    not [file for folder in DRIVERS if folder.is_dir() for file in folder.glob("*.json")],
    reason="no Vulkan driver here: install mesa-vulkan-drivers and libvulkan1",
)
PNG = b"\x89PNG\r\n\x1a\n"


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


def test_what_is_no_whole_recording_is_refused_at_once_with_what_to_do(tmp_path: Path) -> None:
    mcap = tmp_path / "x.mcap"
    mcap.write_bytes(b"\x89MCAP0\r\n" + bytes(100))
    with pytest.raises(LindyError, match=r"x\.mcap is not a recording of Lindy, or is cut off"):
        picture(mcap, out=tmp_path / "dive.png")
    renamed = mcap.rename(tmp_path / "x.rrd")
    with pytest.raises(LindyError, match=r"x\.rrd shows no dive: it does not begin"):
        picture(renamed, out=tmp_path / "dive.png")


@pytest.mark.slow
@needs_vulkan
def test_a_recording_becomes_a_picture(tmp_path: Path) -> None:
    out = tmp_path / "pictures" / "dive.png"
    picture(recording(tmp_path / "dive.rrd"), out=out, at=1.5)
    data = out.read_bytes()
    assert data.startswith(PNG)
    assert (int.from_bytes(data[16:20], "big"), int.from_bytes(data[20:24], "big")) == (1600, 900)


@needs_vulkan
def test_a_time_outside_the_dive_is_refused_with_its_limits(tmp_path: Path) -> None:
    rrd = recording(tmp_path / "dive.rrd")
    with pytest.raises(LindyError, match=r"--at 9: .* from 0\.0 to 3\.0 s"):
        picture(rrd, out=tmp_path / "dive.png", at=9.0)


@needs_vulkan
def test_a_file_that_is_no_dive_is_one_sentence(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("tools.picture.IDLE_S", 0.5)
    other = tmp_path / "other.rrd"
    stream = rr.RecordingStream("lindy", recording_id="other")
    stream.save(other)
    stream.log("text", rr.TextDocument("no dive"), static=True)
    stream.flush()
    stream.disconnect()
    with pytest.raises(LindyError, match=r"other\.rrd shows no dive"):
        picture(other, out=tmp_path / "other.png")


@pytest.mark.slow
@needs_vulkan
def test_pages_differ(tmp_path: Path) -> None:
    rrd, pictures = recording(tmp_path / "dive.rrd", laid_out=True), set[bytes]()
    for page in (pages := ["dive", *PAGES]):
        out = tmp_path / f"{page}.png"
        picture(rrd, out=out, at=1.5, page=page)
        pictures.add(out.read_bytes())
    assert len(pictures) == len(pages)


@needs_vulkan
def test_a_page_that_the_recording_lacks_is_said(tmp_path: Path) -> None:
    with pytest.raises(LindyError, match=r"--page link: .*dive\.rrd has no such page"):
        picture(recording(tmp_path / "dive.rrd"), out=tmp_path / "link.png", at=1.5, page="link")


def test_without_vulkan_the_sentence_names_the_packages(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("VK_DRIVER_FILES", "VK_ICD_FILENAMES"):
        monkeypatch.setenv(name, str(tmp_path / "none.json"))
    with pytest.raises(LindyError, match="mesa-vulkan-drivers and libvulkan1"):
        picture(recording(tmp_path / "dive.rrd"), out=tmp_path / "dive.png")


@pytest.mark.parametrize("name", [".", "dive.rrd", "dive.mcap"])
def test_a_folder_and_the_other_recording_stand_for_the_visualizer_s(
    tmp_path: Path, name: str
) -> None:
    recording(tmp_path / "dive.rrd")
    assert rrd_of(tmp_path / name) == tmp_path / "dive.rrd"


class Viewer:
    """Reads for a while and then shows no dive."""

    def __init__(self, reading: int) -> None:
        self.left = reading

    def get_state(self) -> SimpleNamespace:
        self.left -= 1
        return SimpleNamespace(loading=self.left > 0, views=[], recordings=[])


def test_a_viewer_that_has_read_everything_and_has_no_dive_is_not_waited_for(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    now = [0.0]

    def sleep(seconds: float) -> None:
        now[0] += seconds

    monkeypatch.setattr("tools.picture.time.monotonic", lambda: now[0])
    monkeypatch.setattr("tools.picture.time.sleep", sleep)
    with pytest.raises(LindyError, match="shows no dive"):
        loaded(cast(Any, Viewer(200)), Path("x.rrd"))
    assert 20.0 < now[0] < 20.0 + IDLE_S + 1.0


@pytest.mark.filterwarnings("ignore:RRD file has no footer")
def test_an_imported_recording_is_drawn(tmp_path: Path) -> None:
    out = tmp_path / "dive"
    import_log(ulog(tmp_path / "1.ulg"), map_=None, out=out, vehicle=None)
    before = sorted(path.name for path in out.iterdir())
    draw(open_source(out), tmp_path / "dive.rrd")
    reader = rr.chunk.RrdReader(str(tmp_path / "dive.rrd"))
    drawn = reader.stream().filter(content="/depth/autopilot", is_static=False)
    batches = [part.to_record_batch() for part in drawn]
    times = np.concatenate([np.asarray(b["dive"]).astype(np.int64) / 1e9 for b in batches]).tolist()
    depths = np.concatenate([b["Scalars:scalars"].flatten() for b in batches]).tolist()
    assert depths == pytest.approx([k / SLOW_HZ for k in range(2 * SLOW_HZ)])
    assert times == pytest.approx(depths)  # it sinks by 1 m/s
    assert sorted(path.name for path in out.iterdir()) == before
