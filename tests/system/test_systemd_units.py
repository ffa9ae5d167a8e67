"""The unit files: systemd understands every line, and lets the services reach little."""

import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from services.runtime.config.settings import deploy_file

ANALYZE = shutil.which("systemd-analyze")
EXPOSURE = 2.0  # most, of 10; 1.3 and 1.7 with systemd 252
UNITS = sorted(deploy_file("systemd", "lindy-drone", ".service").parent.glob("*.service"))

pytestmark = [
    pytest.mark.system,
    pytest.mark.skipif(ANALYZE is None, reason="systemd-analyze is not installed"),
]


def installed(unit: Path, folder: Path) -> Path:
    """The unit as if Lindy were installed where these tests are: systemd looks for the command."""
    lindy = Path(sys.executable).with_name("lindy")
    copy = folder / unit.name
    copy.write_text(unit.read_text().replace("/opt/lindy/.venv/bin/lindy", str(lindy)))
    return copy


def analyzed(*words: str) -> subprocess.CompletedProcess[str]:
    assert ANALYZE is not None
    return subprocess.run([ANALYZE, *words], capture_output=True, text=True, check=False)


@pytest.mark.parametrize("unit", UNITS, ids=lambda unit: unit.stem)
def test_systemd_has_nothing_to_say_about_a_unit(tmp_path: Path, unit: Path):
    ran = analyzed("verify", str(installed(unit, tmp_path)))
    said = [line for line in ran.stderr.splitlines() if unit.stem in line]
    assert (ran.returncode, said) == (0, [])


@pytest.mark.parametrize("unit", UNITS, ids=lambda unit: unit.stem)
def test_a_unit_can_reach_little(tmp_path: Path, unit: Path):
    path = str(installed(unit, tmp_path))
    ran = analyzed("security", "--offline=true", "--no-pager", path)
    if "unrecognized option" in ran.stderr:
        pytest.skip("this systemd-analyze cannot judge a file that is not installed")
    found = re.search(r"Overall exposure level for \S+: ([\d.]+)", ran.stdout)
    assert found is not None, ran.stderr
    print(found[0])
    assert float(found[1]) <= EXPOSURE


def test_both_sides_have_a_unit():
    assert [unit.name for unit in UNITS] == ["lindy-drone.service", "lindy-topside.service"]
