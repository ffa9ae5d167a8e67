"""Ctrl-C while the command still loads, and terminals of all kinds."""

import io
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from tools.__main__ import main

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


@pytest.mark.parametrize("module", ["cyclopts", "tools.tuning.lq"])
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
