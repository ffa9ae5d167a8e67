"""A shell completes verbs, verbs below verbs, and options."""

import shutil
import subprocess
from pathlib import Path

import pytest

from tools import completion
from tools.__main__ import LOG, VERBS, main

ASK = """
source "$1"; shift
how=$(complete -p lindy | sed 's/.*-F \\([^ ]*\\).*/\\1/')
COMP_WORDS=("$@"); COMP_CWORD=$(($# - 1)); "$how"; echo "${COMPREPLY[@]}"
"""


@pytest.fixture(scope="module")
def script(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("completion") / "lindy.bash"
    path.write_text(completion.script("bash"))
    return path


@pytest.mark.skipif(shutil.which("bash") is None, reason="no bash")
@pytest.mark.parametrize(
    ("typed", "meant"),
    [("lindy simul", "simulate"), ("lindy simulate --see", "--seed"), ("lindy log comp", "compare"),
     ("lindy link sh", "show"), ("lindy keys re", "revoke")],
)  # fmt: skip
def test_bash_completes(script: Path, typed: str, meant: str) -> None:
    done = subprocess.run(
        ["bash", "-c", ASK, "bash", str(script), *typed.split()],
        capture_output=True, text=True, check=True,
    )  # fmt: skip
    assert done.stdout.split() == meant.split(), done.stderr


@pytest.mark.parametrize("shell", ["zsh", "fish"])
def test_other_shells_know_every_verb(shell: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["completion", shell]) == 0
    said = capsys.readouterr().out
    assert all(verb in said for verb in {*VERBS, *LOG} - {"figures", "bench"})
