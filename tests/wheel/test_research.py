"""The package lindy-research, installed beside the wheel: its two verbs need no clone."""

import json
import subprocess
import sys

import pytest

from tests.wheel.conftest import ROOT, Installed

pytestmark = [pytest.mark.slow, pytest.mark.system]
FIGURES = ("andren-5.1", "observer-depth")


@pytest.fixture(scope="module")
def research(tmp_path_factory: pytest.TempPathFactory) -> str:
    """What comes before a command, so that it finds the package."""
    folder = tmp_path_factory.mktemp("research")
    build = [sys.executable, "-P", "-m", "hatchling", "build", "-t", "wheel", "-d", str(folder)]
    subprocess.run(build, cwd=ROOT / "research", check=True)
    (wheel,) = folder.glob("*.whl")
    pip = [sys.executable, "-P", "-m", "pip", "install", "--quiet", "--no-index", "--no-deps"]
    subprocess.run([*pip, "--target", str(folder / "packages"), str(wheel)], check=True)
    return f"PYTHONPATH={folder / 'packages'}"


def test_figures_are_drawn_and_every_claim_is_checked(installed: Installed, research: str) -> None:
    command = f"{research} lindy figures --only {' '.join(FIGURES)} --out figures"
    status, said, wrong = installed.run(command)
    assert (status, wrong) == (0, ""), said
    drawn = installed.desk / "figures"
    kinds = {f"{name}.{kind}" for name in FIGURES for kind in ("png", "svg")}
    assert {path.name for path in drawn.iterdir()} == kinds | {"claims.json"}
    claims = json.loads((drawn / "claims.json").read_text(encoding="utf-8"))
    assert len(claims) == 136
    assert not [c["id"] for c in claims if c["verdict"] == "differs" and not c["why"]]


def test_a_section_of_the_bench_is_measured(installed: Installed, research: str) -> None:
    status, said, wrong = installed.run(f"{research} lindy bench --only simulator")
    assert status == 0, wrong
    heads, *figures = said.splitlines()
    assert "ours" in heads
    assert {figure.partition(":")[0] for figure in figures} == {"simulator"}
