"""Services are killed while ArduSub's own firmware flies: LINDY_ARDUSUB names its executable."""

import os
from pathlib import Path

import pytest

from lindy_research.ardusub_kills.dive import kill_in_a_dive

FIRMWARE = [path for path in os.environ.get("LINDY_ARDUSUB", "").split(":") if path]


@pytest.mark.system
@pytest.mark.parametrize("service", ["control", "estimation", "hub_drone", "ardusub"])
@pytest.mark.parametrize(
    "kind", FIRMWARE or [pytest.param("", marks=pytest.mark.skip("LINDY_ARDUSUB is not set"))]
)
def test_when_a_service_is_killed_the_outputs_are_neutral_in_its_time(
    tmp_path: Path, kind: str, service: str
) -> None:
    found = kill_in_a_dive(kind, service, tmp_path / "dive")
    own = service == "ardusub"  # nobody is left but the board
    most = 1.0 if own else 0.2  # [s] FS_PILOT_TIMEOUT, or the life of a command
    assert found.neutral is not None
    assert found.neutral <= most + 0.1
    assert ("Lost manual control" in found.texts) == own
