"""The project as it is installed and shipped."""

import re
import shutil
import subprocess
import sys
import tomllib
from importlib.util import find_spec
from pathlib import Path

import pytest

from services.runtime.hosts.registry import Registry
from services.runtime.hosts.service_module import wire_of

ROOT = Path(__file__).parents[1]
PUBLIC = {"https://pypi.org", "https://files.pythonhosted.org"}


@pytest.mark.parametrize("name", ["services", "messages", "tools"])
def test_no_other_distribution_shadows_our_folders(name: str) -> None:
    spec = find_spec(name)
    assert spec is not None
    assert spec.origin is not None
    assert Path(spec.origin).is_relative_to(ROOT)


def test_the_lock_file_names_only_the_public_index() -> None:
    hosts = re.findall(r"https?://[^/\"]+", (ROOT / "uv.lock").read_text(encoding="utf-8"))
    assert set(hosts) <= PUBLIC


def test_every_service_of_the_dive_can_be_wired() -> None:
    for service in Registry.read():
        assert callable(wire_of(service))


@pytest.fixture(scope="module")
def installed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with what the wheel brings, and nothing else of ours."""
    wheel = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    wheel = wheel["tool"]["hatch"]["build"]["targets"]["wheel"]
    left_out = {str(ROOT) + path for path in wheel["exclude"]}

    def ignored(folder: str, names: list[str]) -> set[str]:
        return {n for n in names if f"{folder}/{n}" in left_out or n == "__pycache__"}

    site = tmp_path_factory.mktemp("site")
    for package in wheel["packages"]:
        shutil.copytree(ROOT / package, site / package, ignore=ignored)
    for source, place in wheel["force-include"].items():
        shutil.copytree(ROOT / source, site / place)
    return site


def lindy(site: Path, *words: str) -> subprocess.CompletedProcess[str]:
    code = "import sys; sys.path.insert(0, sys.argv.pop(1)); import tools.__main__ as lindy; "
    code += "assert lindy.__file__.startswith(sys.path[0]); sys.exit(lindy.main())"
    command = [sys.executable, "-P", "-c", code, str(site), *words]
    return subprocess.run(command, capture_output=True, text=True, check=False, cwd=site)


def test_the_wheel_leaves_out_the_papers_tools_and_the_rest_answers(installed: Path) -> None:
    assert not (installed / "tools/research").exists()
    assert (installed / "tools/up.py").is_file()
    asked = lindy(installed, "--help")
    assert asked.returncode == 0, asked.stderr
    for verb in ("dive", "simulate", "path", "figures", "bench", "profile", "ramp"):
        assert f" {verb} " in asked.stdout


PROFILE = "--length 50 --cruise 0.3 --accel-time 20 --decel-time 20"


@pytest.mark.parametrize(
    "words",
    [
        "figures --out figures",
        "bench --only reference",
        f"profile {PROFILE}",
        "path fernandes",
        "ramp --jerk 3 --plan --to 0.3",
    ],
)
def test_a_verb_of_the_papers_tools_says_where_it_is_found(installed: Path, words: str) -> None:
    asked = lindy(installed, *words.split())
    verb = words.split()[0]
    assert (asked.returncode, asked.stdout) == (1, "")
    assert asked.stderr == (
        f"lindy: what `lindy {verb}` needs here belongs to the papers' tools, which are in the "
        f"source tree, not in the installed package; run it there: uv run lindy {verb}\n"
    )


def test_a_path_with_the_law_that_is_flown_needs_no_papers_tools(installed: Path) -> None:
    (installed / "mine.toml").write_text("waypoints = [[0.0, 0.0], [10.0, 0.0], [10.0, 10.0]]")
    asked = lindy(installed, "path", "mine.toml")
    assert asked.returncode == 0, asked.stderr
    assert '"length"' in asked.stdout


def test_in_the_source_tree_the_papers_tools_are_there() -> None:
    assert lindy(ROOT, *f"profile {PROFILE}".split()).returncode == 0
