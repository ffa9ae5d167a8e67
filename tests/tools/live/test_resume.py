"""`lindy up drone --resume`: what was learnt before a power cut is known again."""

import os
from pathlib import Path

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from messages.identity import SideIdentity
from services.estimation.checkpoint import EstimationCheckpoint
from services.runtime.config.errors import LindyError
from tools.live.resume import LONGEST_S, NOTE, StartNote, resumed

S = 1_000_000_000  # [ns]
LEARNT = EstimationCheckpoint(
    stamp_ns=5_000 * S, atmosphere=101_300.0, atmosphere_std=20.0, gyro_bias=(0.01, 0.0, -0.01),
    accelerometer_bias=(0.0, 0.0, 0.02), heading=1.0, heading_std=0.1, north=0.3,
)  # fmt: skip
WRITTEN_S = 1_800_000_000.0  # [s] UTC
OURS = SideIdentity(vehicle="pioneer", vehicle_hash="a1")
BEGAN = StartNote("another", "rov2", 7 * S, vehicle_file="pioneer", vehicle_hash="a1")


def dive_with(folder: Path, data: bytes, name: str = "checkpoints") -> Path:
    path = folder / name / "estimation.json"
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(data)
    (path.parent / f"{NOTE}.json").write_bytes(msgspec.json.encode(BEGAN))
    os.utime(path, (WRITTEN_S, WRITTEN_S))
    return folder


@given(st.floats(0.0, LONGEST_S), st.integers(0, 10**15))
def test_only_the_moment_is_turned_into_the_new_clock(
    tmp_path_factory: pytest.TempPathFactory, age_s: float, clock_ns: int
) -> None:
    dive = dive_with(tmp_path_factory.mktemp("dive"), msgspec.json.encode(LEARNT))
    found = resumed(dive, OURS, clock_ns, WRITTEN_S + age_s)
    now = msgspec.json.decode(found, type=EstimationCheckpoint)
    assert clock_ns - now.stamp_ns == pytest.approx(age_s * S, abs=S / 1000)
    assert msgspec.structs.replace(now, stamp_ns=LEARNT.stamp_ns) == LEARNT


def test_of_several_starts_in_one_folder_the_newest_counts(tmp_path: Path) -> None:
    dive_with(tmp_path, msgspec.json.encode(LEARNT))
    newer = msgspec.structs.replace(LEARNT, heading=2.0)
    dive_with(tmp_path, msgspec.json.encode(newer), "checkpoints-2")
    os.utime(tmp_path / "checkpoints-2" / "estimation.json", (WRITTEN_S + 9.0, WRITTEN_S + 9.0))
    found = resumed(tmp_path, OURS, 0, WRITTEN_S + 10.0)
    assert msgspec.json.decode(found, type=EstimationCheckpoint).heading == 2.0


@pytest.mark.parametrize("age_s", [-60.0, LONGEST_S + 1.0, 86_400.0])
def test_what_is_too_old_or_of_a_wrong_clock_is_refused(tmp_path: Path, age_s: float) -> None:
    dive = dive_with(tmp_path, msgspec.json.encode(LEARNT))
    with pytest.raises(LindyError, match=r"estimation\.json was written .* expected 0 to 1800 s"):
        resumed(dive, OURS, 0, WRITTEN_S + age_s)


@pytest.mark.parametrize("data", [b"", b"{}", b'{"stamp_ns": 1', b"\xff\x00"])
def test_what_is_no_checkpoint_is_refused(tmp_path: Path, data: bytes) -> None:
    with pytest.raises(LindyError, match=r"estimation\.json is not a checkpoint"):
        resumed(dive_with(tmp_path, data), OURS, 0, WRITTEN_S)


def test_a_folder_without_a_checkpoint_is_refused(tmp_path: Path) -> None:
    with pytest.raises(LindyError, match=r"there is no checkpoints/estimation\.json in"):
        resumed(tmp_path, OURS, 0, WRITTEN_S)


@pytest.mark.parametrize(
    ("note", "why"),
    [
        (msgspec.structs.replace(BEGAN, vehicle_file="other", vehicle_hash="b2"), "vehicle other"),
        (msgspec.structs.replace(BEGAN, vehicle_file="", vehicle_hash=""), "with which vehicle"),
        (None, "with which vehicle"),
    ],
)
def test_what_another_vehicle_learnt_is_refused(
    tmp_path: Path, note: StartNote | None, why: str
) -> None:
    dive = dive_with(tmp_path, msgspec.json.encode(LEARNT))
    path = dive / "checkpoints" / f"{NOTE}.json"
    if note is None:
        path.unlink()
    else:
        path.write_bytes(msgspec.json.encode(note))
    with pytest.raises(LindyError, match=rf"estimation\.json is not taken over: .*{why}"):
        resumed(dive, OURS, 0, WRITTEN_S)
