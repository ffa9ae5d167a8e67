"""Services are killed, hang or lose the board while ArduSub's own firmware flies: LINDY_ARDUSUB
names its executable."""

import os
from pathlib import Path

import pytest

from lindy_research.ardusub_kills.dive import kill_in_a_dive
from lindy_research.ardusub_kills.faults import fault_in_a_dive

TIMEOUT_S = 1.0  # [s] FS_PILOT_TIMEOUT
FIRMWARE = [path for path in os.environ.get("LINDY_ARDUSUB", "").split(":") if path]
KINDS = pytest.mark.parametrize(
    "kind", FIRMWARE or [pytest.param("", marks=pytest.mark.skip("LINDY_ARDUSUB is not set"))]
)


@pytest.mark.system
@pytest.mark.parametrize("service", ["control", "estimation", "hub_drone", "ardusub"])
@KINDS
def test_when_a_service_is_killed_the_outputs_are_neutral_in_its_time(
    tmp_path: Path, kind: str, service: str
) -> None:
    found = kill_in_a_dive(kind, service, tmp_path / "dive")
    own = service == "ardusub"  # nobody is left but the board
    most = TIMEOUT_S if own else 0.2  # [s] or the life of a command
    assert found.neutral is not None
    assert found.neutral <= most + 0.1
    assert ("Lost manual control" in found.texts) == own


@pytest.mark.slow
@pytest.mark.system
@pytest.mark.parametrize("fault", ["killed", "hung"])
@KINDS
def test_after_a_death_or_a_hang_of_the_driver_the_stick_acts_again_by_itself(
    tmp_path: Path, kind: str, fault: str
) -> None:
    found = fault_in_a_dive(kind, fault, tmp_path / "dive")
    assert found.stopped is not None
    assert found.stopped <= TIMEOUT_S + 0.1
    assert found.alone is not None, found.said


@pytest.mark.slow
@pytest.mark.system
@KINDS
def test_a_cable_that_was_pulled_ends_the_arming_and_the_pilot_reads_it(
    tmp_path: Path, kind: str
) -> None:
    found = fault_in_a_dive(kind, "pulled", tmp_path / "dive")
    assert found.stopped is not None
    assert found.stopped <= TIMEOUT_S + 0.1
    assert found.alone is None, "the board was disarmed, and not by Lindy"
    assert [line for line in found.said if "disarm and arm to go on" in line]
    assert found.again


@pytest.mark.slow
@pytest.mark.system
@KINDS
def test_a_board_that_reboots_is_known_by_its_clock_and_flies_after_arming(
    tmp_path: Path, kind: str
) -> None:
    found = fault_in_a_dive(kind, "rebooted", tmp_path / "dive")
    assert found.alone is None
    assert [line for line in found.said if "so the board was restarted" in line]
    assert found.again
