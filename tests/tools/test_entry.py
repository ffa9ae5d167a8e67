"""The command as it begins and ends: Ctrl-C while it loads, terminals of all kinds, nobody who
reads, and shells that complete it."""

import io
import os
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from messages.health import LogLine
from tools import completion
from tools.__main__ import LOG, VERBS, main
from tools.live.screen import LineDisplay, View

ROOT = Path(__file__).parents[2]
# As the installed `lindy` begins; it then loads one module for ever.
BEGINNING = """
import sys, time
sys.path.insert(0, {root!r})
from tools.__main__ import main
class Slow:
    def find_spec(self, name, path=None, target=None):
        if name == {module!r}:
            print("loading", flush=True)
            time.sleep(600)
sys.meta_path.insert(0, Slow())
sys.exit(main())
"""


@pytest.mark.parametrize("module", ["cyclopts", "tools.gains"])
def test_an_early_ctrl_c_is_one_sentence(module: str):
    lindy = subprocess.Popen(
        [sys.executable, "-P", "-c", BEGINNING.format(root=str(ROOT), module=module), "gains"],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        # Tests that were started in the background have inherited that it is ignored.
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
    )  # fmt: skip
    assert lindy.stdout is not None
    assert lindy.stdout.readline() == "loading\n"
    lindy.send_signal(signal.SIGINT)
    _, said = lindy.communicate()
    assert (lindy.returncode, said) == (130, "lindy: interrupted\n")


def test_who_started_it_may_have_it_ignore_ctrl_c():
    lindy = subprocess.Popen(
        [sys.executable, "-P", "-c", BEGINNING.format(root=str(ROOT), module="cyclopts"), "gains"],
        stdout=subprocess.PIPE,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_IGN),
    )
    assert lindy.stdout is not None
    assert lindy.stdout.readline() == b"loading\n"
    lindy.send_signal(signal.SIGINT)
    lindy.terminate()
    lindy.communicate()
    assert lindy.returncode == -signal.SIGTERM  # and not the first signal


@pytest.mark.parametrize("name", ["stdout", "stderr"])
def test_where_stdout_or_stderr_are_closed_what_is_printed_goes_nowhere(
    monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    monkeypatch.setattr(sys, name, None)
    assert main(["--version"]) == 0
    assert main(["no-such-verb"]) == 1
    assert getattr(sys, name).isatty() is False
    getattr(sys, name).close()


def test_of_a_long_argument_the_ends_are_repeated(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["simulate", "--link", "x" * 100_000]) == 1
    said = capsys.readouterr().err
    assert len(said) < 2100
    assert "tether" in said  # what is allowed


def test_what_a_terminal_has_no_letter_for_ends_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    written = io.BytesIO()
    monkeypatch.setattr(sys, "stdout", io.TextIOWrapper(written, encoding="ascii"))
    assert main(["--version"]) == 0
    print("pioneer → dives/mine", flush=True)
    assert written.getvalue().endswith(b"pioneer ? dives/mine\n")


@pytest.mark.parametrize(
    ("error", "sentence"),
    [
        (MemoryError(), "there is not enough memory for this"),
        (ImportError("libarrow.so: failed to map"), "a library cannot be loaded: libarrow.so: "),
    ],
)
def test_too_little_memory_is_no_error_of_lindy(
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    error: Exception,
    sentence: str,
) -> None:
    def fails(*_: object) -> int:
        raise error

    monkeypatch.setattr("tools.__main__._run", fails)
    assert main(["simulate"]) == 1
    assert f"lindy: {sentence}" in capsys.readouterr().err


UNREAD = 141


def unread(*words: str, unbuffered: bool) -> subprocess.CompletedProcess[str]:
    """Runs a verb whose output nobody reads."""
    reader, writer = os.pipe()
    os.close(reader)
    try:
        return subprocess.run(
            [sys.executable, "-m", "tools", *words],
            env={**os.environ, "PYTHONUNBUFFERED": "1" if unbuffered else ""},
            cwd=ROOT, stdout=writer, stderr=subprocess.PIPE, text=True, check=False,
        )  # fmt: skip
    finally:
        os.close(writer)


@pytest.mark.parametrize(
    ("words", "unbuffered"),
    [(("log", "--help"), False), (("gains", "depth"), True)],
)
def test_output_that_nobody_reads_ends_a_verb_quietly(words: tuple[str, ...], unbuffered: bool):
    ended = unread(*words, unbuffered=unbuffered)
    assert (ended.returncode, ended.stderr) == (UNREAD, "")


def test_a_dive_goes_on_when_nobody_reads_its_lines(monkeypatch: pytest.MonkeyPatch):
    reader, writer = os.pipe()
    os.close(reader)
    with os.fdopen(writer, "w", buffering=1) as nobody:
        monkeypatch.setattr(sys, "stdout", nobody)
        shown = LineDisplay()
        shown.show(lambda: View(title="x"))
        shown.line(LogLine(stamp_ns=0, service="x", level="warning", text="x"), 1.0)
        shown.finish()
        monkeypatch.undo()
        os.dup2(os.open(os.devnull, os.O_WRONLY), nobody.fileno())


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


@pytest.mark.parametrize("shell", ["zsh", pytest.param("fish", marks=pytest.mark.slow)])
def test_other_shells_know_every_verb(shell: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["completion", shell]) == 0
    said = capsys.readouterr().out
    assert all(verb in said for verb in {*VERBS, *LOG} - {"figures", "bench"})
