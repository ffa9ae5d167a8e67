"""What was learnt before a start of the drone's side broke off, or power was cut, is known
again."""

import os
import time
from pathlib import Path
from typing import NamedTuple

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from messages.identity import SideIdentity
from services.estimation.checkpoint import EstimationCheckpoint
from services.runtime.config.errors import LindyError
from services.runtime.config.running import RUNNING, Running
from services.runtime.config.stack import Stack
from tools.live.resume import (
    ESTIMATION,
    LONGEST_S,
    NOTE,
    StartNote,
    begin_with,
    boot_id,
    broken_off,
    mark_ended,
    other_vehicle,
    read,
    resumed,
)

S = 1_000_000_000  # [ns]
NOW = 100_000 * S
LEARNT = EstimationCheckpoint(
    stamp_ns=NOW - 5 * S, atmosphere=101_300.0, atmosphere_std=20.0, gyro_bias=(0.01, 0.0, -0.01),
    accelerometer_bias=(0.0, 0.0, 0.02), heading=1.0, heading_std=0.1, north=0.3,
)  # fmt: skip
BROKEN = StartNote("this", "pioneer", 7 * S, vehicle_file="pioneer", vehicle_hash="a1")


def dive(folder: Path, start: StartNote | bytes = BROKEN, learnt: bytes | None = None) -> Path:
    checkpoints = folder / "checkpoints"
    checkpoints.mkdir(parents=True)
    data = start if isinstance(start, bytes) else msgspec.json.encode(start)
    (checkpoints / f"{NOTE}.json").write_bytes(data)
    (checkpoints / "reference.json").write_bytes(b'{"armed": true}')
    learnt = msgspec.json.encode(LEARNT) if learnt is None else learnt
    if learnt:
        (checkpoints / "estimation.json").write_bytes(learnt)
    return folder


def test_a_dive_that_broke_off_on_this_start_is_gone_on_with(tmp_path: Path):
    folder = dive(tmp_path / "dive")
    found = broken_off(tmp_path, "this", "pioneer", NOW)
    assert found is not None
    assert (found.folder, found.age_s) == (folder, 5.0)
    assert msgspec.json.decode(found.checkpoint, type=EstimationCheckpoint) == LEARNT


@pytest.mark.parametrize(
    ("start", "learnt"),
    [
        (msgspec.structs.replace(BROKEN, ended=True), None),
        (msgspec.structs.replace(BROKEN, boot_id="another"), None),
        (msgspec.structs.replace(BROKEN, vehicle="another"), None),
        (b"{}", None),
        (b"\xff", None),
        (BROKEN, b""),
        (BROKEN, b"{"),
    ],
)
def test_no_other_dive_is(tmp_path: Path, start: StartNote | bytes, learnt: bytes | None):
    dive(tmp_path / "dive", start, learnt)
    assert broken_off(tmp_path, "this", "pioneer", NOW) is None


def test_a_dive_that_goes_on_is_left_alone(tmp_path: Path):
    folder = dive(tmp_path / "dive")
    going_on = Running("pioneer", {}, os.getpid(), {})
    (folder / RUNNING).write_bytes(msgspec.json.encode(going_on))
    assert broken_off(tmp_path, "this", "pioneer", NOW) is None


@given(st.floats(-100.0, 2 * LONGEST_S))
def test_what_is_too_old_or_of_the_future_is_not_used(
    tmp_path_factory: pytest.TempPathFactory, age_s: float
):
    folder = tmp_path_factory.mktemp("dives")
    dive(folder / "dive")
    found = broken_off(folder, "this", "pioneer", LEARNT.stamp_ns + round(age_s * 1e9))
    assert (found is not None) == (0 <= round(age_s * 1e9) <= LONGEST_S * S)


def test_one_that_was_ended_beside_it_hides_none_that_broke_off(tmp_path: Path):
    folder = dive(tmp_path / "dive")
    beside = msgspec.structs.replace(BROKEN, began_ns=LEARNT.stamp_ns - 60 * S, ended=True)
    dive(tmp_path / "beside", beside, b"")
    found = broken_off(tmp_path, "this", "pioneer", NOW)
    assert found is not None
    assert found.folder == folder


class Earlier(NamedTuple):
    began_s: int
    ended: bool


@given(st.lists(st.builds(Earlier, st.integers(0, 50), st.booleans()), unique_by=lambda e: e[0]))
def test_only_the_newest_counts(tmp_path_factory: pytest.TempPathFactory, earlier: list[Earlier]):
    folder = tmp_path_factory.mktemp("dives")
    for number, one in enumerate(earlier):
        start = msgspec.structs.replace(BROKEN, began_ns=one.began_s * S, ended=one.ended)
        dive(folder / str(number), start)
    found = broken_off(folder, "this", "pioneer", NOW)
    newest = max(earlier, default=None)
    if newest is None or newest.ended:
        assert found is None
    else:
        assert found is not None
        assert found.folder == folder / str(earlier.index(newest))


def test_a_deliberate_end_is_noted(tmp_path: Path):
    checkpoints = dive(tmp_path / "dive") / "checkpoints"
    mark_ended(checkpoints)
    assert read(checkpoints / f"{NOTE}.json") == msgspec.structs.replace(BROKEN, ended=True)
    assert broken_off(tmp_path, "this", "pioneer", NOW) is None
    mark_ended(tmp_path)  # no note: nothing to do
    assert list(tmp_path.iterdir()) == [tmp_path / "dive"]


def test_what_was_learnt_is_of_the_vehicle_only_with_the_same_hash():
    same = SideIdentity(vehicle="pioneer", vehicle_hash="a1")
    assert other_vehicle(BROKEN, same) == ""
    why = other_vehicle(BROKEN, SideIdentity(vehicle="bluerov2_heavy", vehicle_hash="b2"))
    assert why == (
        "it was measured with the vehicle pioneer, and the table [vehicle] of bluerov2_heavy "
        "differs, or a --set"
    )
    older = msgspec.structs.replace(BROKEN, vehicle_file="", vehicle_hash="")
    for then in (None, older):
        assert "with which vehicle" in other_vehicle(then, same)
        assert other_vehicle(then, SideIdentity())  # two that are not known are not the same


@pytest.mark.skipif(boot_id() is None, reason="only Linux numbers its starts")
@pytest.mark.parametrize(
    ("vehicle", "overrides", "goes_on"),
    [
        ("pioneer", [], True),
        ("pioneer", ["control.depth.kp=120"], True),
        ("pioneer", ["vehicle.mass=99"], False),
        ("bluerov2_heavy", [], False),
    ],
)
def test_a_start_goes_on_only_with_the_calibration_of_its_own_vehicle(
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    vehicle: str,
    overrides: list[str],
    goes_on: bool,
):
    first = Stack(vehicle="pioneer", name="rov2", out=str(tmp_path / "rov2"))
    note = begin_with(first)
    assert list(note) == [NOTE]
    learnt = msgspec.structs.replace(LEARNT, stamp_ns=time.monotonic_ns())
    folder = dive(tmp_path / "rov2", note[NOTE], msgspec.json.encode(learnt))
    assert capsys.readouterr().out == ""
    second = msgspec.structs.replace(
        first, vehicle=vehicle, overrides=overrides, out=str(tmp_path / "rov2-2")
    )
    begins_with = begin_with(second)
    said = capsys.readouterr().out
    assert (ESTIMATION in begins_with) == goes_on
    assert said.startswith(f"{'goes' if goes_on else 'does not go'} on with the calibration of")
    assert said.count("\n") == 1
    assert str(folder) in said
    assert ("the table [vehicle] of" in said) != goes_on


@pytest.mark.skipif(boot_id() is None, reason="only Linux numbers its starts")
def test_a_start_of_the_computer_has_one_id():
    assert boot_id() == boot_id() != ""


KEPT = EstimationCheckpoint(
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
    dive = dive_with(tmp_path_factory.mktemp("dive"), msgspec.json.encode(KEPT))
    found = resumed(dive, OURS, clock_ns, WRITTEN_S + age_s)
    now = msgspec.json.decode(found, type=EstimationCheckpoint)
    assert clock_ns - now.stamp_ns == pytest.approx(age_s * S, abs=S / 1000)
    assert msgspec.structs.replace(now, stamp_ns=KEPT.stamp_ns) == KEPT


def test_of_several_starts_in_one_folder_the_newest_counts(tmp_path: Path) -> None:
    dive_with(tmp_path, msgspec.json.encode(KEPT))
    newer = msgspec.structs.replace(KEPT, heading=2.0)
    dive_with(tmp_path, msgspec.json.encode(newer), "checkpoints-2")
    os.utime(tmp_path / "checkpoints-2" / "estimation.json", (WRITTEN_S + 9.0, WRITTEN_S + 9.0))
    found = resumed(tmp_path, OURS, 0, WRITTEN_S + 10.0)
    assert msgspec.json.decode(found, type=EstimationCheckpoint).heading == 2.0


@pytest.mark.parametrize("age_s", [-60.0, LONGEST_S + 1.0, 86_400.0])
def test_what_is_too_old_or_of_a_wrong_clock_is_refused(tmp_path: Path, age_s: float) -> None:
    dive = dive_with(tmp_path, msgspec.json.encode(KEPT))
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
    dive = dive_with(tmp_path, msgspec.json.encode(KEPT))
    path = dive / "checkpoints" / f"{NOTE}.json"
    if note is None:
        path.unlink()
    else:
        path.write_bytes(msgspec.json.encode(note))
    with pytest.raises(LindyError, match=rf"estimation\.json is not taken over: .*{why}"):
        resumed(dive, OURS, 0, WRITTEN_S)
