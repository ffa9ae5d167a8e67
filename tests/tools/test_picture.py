from pathlib import Path

import numpy as np
import pytest

from services.runtime.errors import LindyError
from tools.picture import picture

rr = pytest.importorskip("rerun", reason="the viewer extra is not installed")

DRIVERS = [Path("/usr/share/vulkan/icd.d"), Path("/etc/vulkan/icd.d")]
needs_vulkan = pytest.mark.skipif(
    not any(folder.glob("*.json") for folder in DRIVERS if folder.is_dir()),
    reason="no Vulkan driver here: install mesa-vulkan-drivers and libvulkan1",
)
PNG = b"\x89PNG\r\n\x1a\n"


def recording(path: Path) -> Path:
    """Three seconds of a rising line."""
    stream = rr.RecordingStream("lindy", recording_id=path.stem)
    stream.save(path)
    times = np.array([0, 1_000_000_000, 3_000_000_000], dtype="timedelta64[ns]")
    stream.send_columns(
        "depth",
        indexes=[rr.TimeColumn("dive", duration=times)],
        columns=rr.Scalars.columns(scalars=[0.0, 1.0, 3.0]),
    )
    stream.flush()
    stream.disconnect()
    return path


@needs_vulkan
def test_a_recording_becomes_a_picture(tmp_path: Path) -> None:
    out = tmp_path / "pictures" / "dive.png"
    picture(recording(tmp_path / "dive.rrd"), out, 1.5)
    data = out.read_bytes()
    assert data.startswith(PNG)
    assert (int.from_bytes(data[16:20], "big"), int.from_bytes(data[20:24], "big")) == (1600, 900)


@needs_vulkan
def test_a_time_outside_the_dive_is_refused_with_its_limits(tmp_path: Path) -> None:
    rrd = recording(tmp_path / "dive.rrd")
    with pytest.raises(LindyError, match=r"--at 9: .* from 0\.0 to 3\.0 s"):
        picture(rrd, tmp_path / "dive.png", 9.0)


@needs_vulkan
def test_a_file_that_is_no_dive_is_one_sentence(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("tools.picture.LOAD_S", 0.5)
    other = tmp_path / "other.rrd"
    other.write_bytes(b"not a recording")
    with pytest.raises(LindyError, match=r"other\.rrd shows no dive"):
        picture(other, tmp_path / "other.png", None)


def test_without_vulkan_the_sentence_names_the_packages(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("VK_DRIVER_FILES", "VK_ICD_FILENAMES"):
        monkeypatch.setenv(name, str(tmp_path / "none.json"))
    with pytest.raises(LindyError, match="mesa-vulkan-drivers and libvulkan1"):
        picture(recording(tmp_path / "dive.rrd"), tmp_path / "dive.png", None)


def test_a_recording_that_is_not_there_is_one_sentence(tmp_path: Path) -> None:
    with pytest.raises(LindyError, match=r"there is no recording .*nothing\.rrd"):
        picture(tmp_path / "nothing.rrd", tmp_path / "dive.png", None)
