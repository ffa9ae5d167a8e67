"""`lindy fault` on the pilot's machine: its request would not reach the drone."""

import os
from math import inf, nan
from pathlib import Path

import msgspec
import pytest

from services.runtime.config.errors import LindyError
from services.runtime.config.running import RUNNING, Running
from tools.fault import fault


def test_where_no_drone_is_a_part_cannot_be_broken_and_it_says_where(tmp_path: Path) -> None:
    running = Running("pioneer", {"topside": "tcp/x"}, os.getpid(), {})
    (tmp_path / RUNNING).write_bytes(msgspec.json.encode(running))
    with pytest.raises(LindyError, match="parts are broken on the drone's machine only"):
        fault("port", "dead", dive=tmp_path)


@pytest.mark.parametrize("value", [nan, inf, -inf, 1e30])
def test_a_value_that_no_message_may_have_is_refused_before_anybody_is_asked(
    tmp_path: Path, value: float
) -> None:
    with pytest.raises(LindyError, match=r"^--value is "):
        fault("port", "weak", value=value, dive=tmp_path)
