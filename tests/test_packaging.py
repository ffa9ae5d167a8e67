"""The project as it is installed and shipped."""

import json
import re
import subprocess
import sys
import tomllib
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path

import pytest

from messages.version import VERSION
from services.runtime.config.extras import how_to_install
from services.runtime.hosts.registry import Registry, wire_of
from tools.__main__ import main

ROOT = Path(__file__).parents[1]
PUBLIC = {"https://pypi.org", "https://files.pythonhosted.org"}


@pytest.mark.parametrize("name", ["services", "messages", "tools", "lindy"])
def test_no_other_distribution_shadows_our_folders(name: str) -> None:
    spec = find_spec(name)
    assert spec is not None
    assert spec.origin is not None
    assert Path(spec.origin).is_relative_to(ROOT)


def test_lindy_says_the_version_that_is_installed() -> None:
    cited = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    assert version("lindy") == VERSION
    assert f"\nversion: {VERSION}\n" in cited


def test_no_service_asks_the_installed_package_for_it() -> None:
    """It would take each process on board up to 2 MB and 20 ms."""
    names = "services.__main__, services.link_monitor.service"
    names += ", services.estimation.service, services.reference.service, services.control.service"
    code = f"import sys, {names}; sys.exit('importlib.metadata' in sys.modules)"
    subprocess.run([sys.executable, "-c", code], cwd=ROOT, check=True)


def test_the_lock_file_names_only_the_public_index() -> None:
    hosts = re.findall(r"https?://[^/\"]+", (ROOT / "uv.lock").read_text(encoding="utf-8"))
    assert set(hosts) <= PUBLIC


def test_the_bill_of_materials_is_of_exactly_what_can_be_installed(tmp_path: Path) -> None:
    made = re.search(r"\$\(UV\) (export .*) \\\n", (ROOT / "Makefile").read_text(encoding="utf-8"))
    assert made is not None
    out = tmp_path / "sbom.json"
    command = [sys.executable, "-m", "uv", *made[1].split(), "--output-file", str(out)]
    subprocess.run(command, cwd=ROOT, check=True, capture_output=True)
    listed = json.loads(out.read_text(encoding="utf-8"))["components"]
    assert all(file["hashes"] for each in listed for file in each["externalReferences"])
    assert {(each["name"], each["version"]) for each in listed} == installable()


def installable() -> set[tuple[str, str]]:
    """What Lindy and its extras need, and what these need."""
    lock = tomllib.loads((ROOT / "uv.lock").read_text(encoding="utf-8"))["package"]
    found, wanted = set[tuple[str, str]](), [("lindy", "all")]
    seen = set[tuple[str, str]]()
    while wanted:
        if (one := wanted.pop()) in seen:
            continue
        seen.add(one)
        name, extra = one
        for package in (each for each in lock if each["name"] == name):
            found.add((name, package["version"]))
            needs = [*package.get("dependencies", [])]
            needs += package.get("optional-dependencies", {}).get(extra, [])
            wanted += [(n["name"], e) for n in needs for e in ("", *n.get("extra", []))]
    return {each for each in found if each[0] != "lindy"}


def test_every_service_of_the_dive_can_be_wired() -> None:
    for service in Registry.read():
        assert callable(wire_of(service))


@pytest.mark.parametrize("words", ["figures --out figures", "bench --only reference"])
def test_a_verb_of_research_says_what_to_install(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], words: str
) -> None:
    def none(_: str) -> None:
        return None

    monkeypatch.setattr("tools.__main__.find_spec", none)
    verb = words.split()[0]
    assert main(words.split()) == 1
    said = capsys.readouterr()
    assert said.out == ""
    assert said.err == (
        f"lindy: `lindy {verb}` is in the package lindy-research, which is not installed; "
        f"in the folder of Lindy's source, `uv run lindy {verb}` installs and runs it\n"
    )


@pytest.mark.parametrize(
    ("clone", "said"),
    [
        (True, "in the folder of Lindy's source, `uv sync --extra viewer` installs it"),
        (
            False,
            rf"`pip install 'lindy-{version('lindy')}-py3-none-any.whl\[viewer\]'` installs it.*",
        ),
    ],
)
def test_an_extra_is_installed_as_lindy_itself_was(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, clone: bool, said: str
) -> None:
    monkeypatch.setattr("services.runtime.config.extras.DEPLOY", tmp_path / "deploy")
    if clone:
        (tmp_path / "pyproject.toml").touch()
    assert re.fullmatch(said, how_to_install("viewer"))
