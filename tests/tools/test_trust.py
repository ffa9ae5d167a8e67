"""A person is asked once before code of a stack file runs that is not Lindy's own."""

from collections.abc import Callable
from pathlib import Path

import pytest

from services.runtime.config.errors import LindyError
from services.runtime.hosts.registry import Registry
from tools.__main__ import main
from tools.trust import TRUSTED, foreign, require_trusted

STACK = """
[services.engine]
sides = ["drone"]
vehicle_side = true
module = "engine_of_a_stranger"
"""
EVIL = "import pathlib\npathlib.Path(__file__).with_name('ran').touch()\n"
Ask = Callable[[str], str]


@pytest.fixture
def stranger(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    (tmp_path / "engine_of_a_stranger.py").write_text(EVIL)
    stack = tmp_path / "mine.toml"
    stack.write_text(STACK)
    return stack


def answer(word: str, asked: list[str]) -> Ask:
    def ask(question: str) -> str:
        asked.append(question)
        return word

    return ask


def test_lindys_own_stacks_are_asked_about_by_nobody() -> None:
    for name in ("simulated", "cockpit", "mavlink", "ardusub", "foxglove"):
        services, asked = Registry.read(name), list[str]()
        assert foreign(services) == []
        require_trusted(services, trust=False, ask=answer("", asked))
        assert asked == []


def test_a_person_is_asked_once_for_a_file_as_it_is(stranger: Path) -> None:
    asked: list[str] = []
    for _ in range(2):
        require_trusted(Registry.read(str(stranger)), trust=False, ask=answer("y", asked))
    assert asked == [
        f"{stranger} runs code that is not Lindy's own: engine (module engine_of_a_stranger). "
        f"Run it? [y/N] "
    ]
    stranger.write_text(STACK + "# changed\n")
    require_trusted(Registry.read(str(stranger)), trust=False, ask=answer("Yes", asked))
    assert len(asked) == 2
    assert len(Path(TRUSTED).expanduser().read_text().split()) == 2


@pytest.mark.parametrize("word", ["", "n", "no", "ye"])
def test_who_does_not_say_yes_runs_nothing(stranger: Path, word: str) -> None:
    with pytest.raises(LindyError, match="with --trust nobody is asked"):
        require_trusted(Registry.read(str(stranger)), trust=False, ask=answer(word, []))
    assert not stranger.with_name("ran").exists()


def test_trust_asks_nobody_and_a_script_is_told(
    stranger: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    asked: list[str] = []
    require_trusted(Registry.read(str(stranger)), trust=True, ask=answer("", asked))
    assert (asked, capsys.readouterr().out) == ([], "")
    require_trusted(Registry.read(str(stranger)), trust=False)
    assert "runs code that is not Lindy's own: engine" in capsys.readouterr().out


@pytest.mark.parametrize("verb", ["dive", "simulate"])
def test_nothing_of_a_stack_file_is_imported_before_the_answer(
    stranger: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], verb: str
) -> None:
    monkeypatch.setattr("tools.start.asking", lambda: answer("n", []))
    whole = Path("deploy/stacks/simulated.toml").read_text()
    head, tail = whole.split("[services.simulator]", 1)
    rest = tail.split("[services.", 1)[1]
    stranger.write_text(f"{head}{STACK.strip()}\n\n[services.{rest}")
    out = stranger.with_name("out")
    words = [verb, "--pilot", "script:first_dive", "--stack", str(stranger), "--out", str(out)]
    assert main(words) == 1
    assert "with --trust nobody is asked" in capsys.readouterr().err
    assert not stranger.with_name("ran").exists()
    assert not out.exists()
