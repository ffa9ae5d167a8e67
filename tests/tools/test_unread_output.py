"""Whoever reads the output may end first, as `head` does: then a verb ends quietly."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from messages.health import LogLine
from tools.live.display import LineDisplay
from tools.live.screen import View

ROOT = Path(__file__).parents[2]
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
