"""The import contracts hold for what is not written yet: a new service, a new file in a room."""

import os
import shutil
import subprocess
import sys
from itertools import pairwise
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
LINT = (
    "import sys; from importlinter.cli import lint_imports; "
    "sys.exit(lint_imports(no_cache=True, no_logo=True))"
)
CONTRACTS = {  # what their names begin with
    "down": "Dependencies point down",
    "tests": "Research imports nothing of the tests",
    "bus": "Services meet only on the bus",
    "zenoh": "Only the runtime knows Zenoh",
    "system": "Only service.py, io/ and the runtime know",
    "physics": "What vehicle sides share",
    "runtime": "Rooms of the runtime",
    "reference": "Rooms of reference",
    "control": "Rooms of control",
}
COMPILED = shutil.ignore_patterns("__pycache__")
# A new service as it should be: what thinks is pure, what talks may know the system.
CLEAN = {
    "services/depth_alarm/__init__.py": '"""Says when the drone is deeper than it should be."""',
    "services/depth_alarm/core.py": """
import math
import messages.state
import services.marine.vehicle
""",
    "services/depth_alarm/service.py": """
import messages.topics
import services.depth_alarm.core
import services.depth_alarm.io.siren
import services.runtime.node.node
""",
    "services/depth_alarm/io/__init__.py": '"""The siren on the desk."""',
    "services/depth_alarm/io/siren.py": """
import os, socket, threading, time
import services.runtime.config.errors
""",
}
# (file, what it imports, the contract that refuses it)
OFFENCES = [
    ("services/depth_alarm/core.py", "time", "system"),
    ("services/depth_alarm/core.py", "zenoh", "zenoh"),
    ("services/depth_alarm/core.py", "services.control.core", "bus"),
    ("services/depth_alarm/limits/rule.py", "random", "system"),
    ("services/depth_alarm/io/siren.py", "zenoh", "zenoh"),
    ("messages/units.py", "services.marine.vehicle", "down"),
    ("services/marine/vehicle.py", "services.vehicle.mounting", "physics"),
    ("services/reference/trajectory/corner.py", "services.reference.guidance", "reference"),
    ("services/control/axis/other.py", "services.control.core", "control"),
    ("services/runtime/config/other.py", "services.runtime.bus.spaces", "runtime"),
    ("tools/live/other.py", "lindy_research.laws.stepping", "down"),
    ("lindy_research/laws/other.py", "tests", "tests"),
]


@pytest.fixture
def copy(tmp_path: Path) -> Path:
    """The sources as they are now, with a clean new service among them."""
    for name in ("messages", "services", "tools", "lindy"):
        shutil.copytree(ROOT / name, tmp_path / name, ignore=COMPILED)
    research = tmp_path / "lindy_research"
    shutil.copytree(ROOT / "research" / "lindy_research", research, ignore=COMPILED)
    shutil.copy(ROOT / "pyproject.toml", tmp_path)
    for name, text in CLEAN.items():
        append(tmp_path / name, text)
    return tmp_path


def append(path: Path, text: str) -> None:
    path.parent.mkdir(exist_ok=True)
    (path.parent / "__init__.py").touch()
    with path.open("a") as file:
        file.write(f"\n{text}\n")


def lint(folder: Path) -> tuple[int, str]:
    command = [sys.executable, "-c", LINT]
    wide = {**os.environ, "COLUMNS": "400"}  # one complaint on one line
    linted = subprocess.run(
        command, cwd=folder, env=wide, capture_output=True, text=True, check=False
    )
    return linted.returncode, linted.stdout + linted.stderr


def module(file: str) -> str:
    return file.removesuffix(".py").replace("/", ".")


def complaints(said: str) -> dict[str, str]:
    """What each broken contract complains of, on one line."""
    found, broken = dict[str, str](), ""
    for line, below in pairwise(said.partition("Broken contracts")[2].splitlines()):
        if below.startswith("---"):
            broken = next((key for key, name in CONTRACTS.items() if line.startswith(name)), "")
        found[broken] = f"{found.get(broken, '')} {line.strip()}"
    return found


def test_a_new_service_that_keeps_to_its_side_of_the_line_is_accepted(copy: Path) -> None:
    status, said = lint(copy)
    assert status == 0, said
    assert "BROKEN" not in said


def test_every_new_import_across_a_line_is_refused_by_name(copy: Path) -> None:
    for file, imported, _ in OFFENCES:
        append(copy / file, f"import {imported}")
    status, said = lint(copy)
    assert status == 1, said
    refused = complaints(said)
    for file, imported, contract in OFFENCES:
        offence = f"{module(file)} -> {imported} (l."
        assert offence in refused.get(contract, ""), f"{contract}: {offence}\n{said}"
    innocent = "services.depth_alarm.io.siren -> services.runtime", "siren -> socket", "siren -> os"
    assert not [words for words in innocent if words in said]
