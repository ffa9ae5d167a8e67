"""What one program of the drone's side hands on to the next."""

import subprocess
import sys
from pathlib import Path

import msgspec
import pytest

from services.runtime.config.stack import Stack
from services.runtime.hosts.registry import Registry
from services.runtime.launch.dive import Dive
from tools.health_sums import MOST, HealthSums, Thinned
from tools.onboard.plan import DiveEnd, Seen

ROOT = Path(__file__).parents[3]
BECOME = """
import sys
import msgspec
from tools.onboard.plan import DiveEnd, become, path
data = sys.stdin.buffer.read()
become("report", msgspec.json.decode(data, type=DiveEnd, dec_hook=path))
"""


def dive_end(folder: Path, exit_reason: str, services: int) -> DiveEnd:
    folder.mkdir()
    none = Registry(Path("mine.toml"), {})
    dive = Dive(Stack(out=str(folder), apart=True), none, side="drone", elsewhere=("gamepad",))
    values = Thinned([k / 7.0 for k in range(MOST)])
    health = {f"s{k}": HealthSums(lateness_p50_ms=values) for k in range(services)}
    return DiveEnd(dive, Seen(exit=exit_reason, restarts={"control": 2}, health=health))


@pytest.mark.parametrize(("exit_reason", "status"), [("clean", 3), ("the port is taken", 1)])
@pytest.mark.parametrize("services", [1, 30], ids=["short", "long"])
def test_a_long_dive_is_handed_on_whole(
    tmp_path: Path, exit_reason: str, status: int, services: int
):
    end = msgspec.json.encode(dive_end(tmp_path / "dive", exit_reason, services), enc_hook=str)
    ran = subprocess.run(
        [sys.executable, "-P", "-c", f"import sys; sys.path.insert(0, {str(ROOT)!r})\n{BECOME}"],
        input=end, capture_output=True, check=False, cwd=ROOT,
    )  # fmt: skip
    assert ran.returncode == status, ran.stderr
    said = ran.stdout.decode()
    assert "control 2 ×" in said
    assert "never armed" in said or status == 1
    assert ran.stderr.decode() == ("" if status == 3 else "lindy: the port is taken\n")
