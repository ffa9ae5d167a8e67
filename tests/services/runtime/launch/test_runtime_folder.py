"""What a start leaves behind that was killed is removed by the next one, and nothing else is."""

import subprocess
import sys
import tempfile
from collections.abc import Generator
from pathlib import Path

import pytest

from services.runtime.launch.process_plan import PREFIX, runtime_folder

KILLED = """
import os
from services.runtime.launch.process_plan import runtime_folder
with runtime_folder() as folder:
    (folder / "control.beat").write_text("1")
    print(folder, flush=True)
    input()
"""


@pytest.fixture
def place(monkeypatch: pytest.MonkeyPatch) -> Generator[Path]:
    with tempfile.TemporaryDirectory(prefix="t-") as name:  # short, as a socket's folder must be
        monkeypatch.setattr(tempfile, "tempdir", name)
        monkeypatch.setenv("TMPDIR", name)
        yield Path(name)


def started() -> tuple[subprocess.Popen[str], Path]:
    process = subprocess.Popen(
        [sys.executable, "-P", "-c", KILLED],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    assert process.stdout is not None
    return process, Path(process.stdout.readline().strip())


def test_the_folder_of_a_start_that_was_killed_is_removed_by_the_next(place: Path) -> None:
    process, left = started()
    with runtime_folder() as ours:
        assert left.exists()  # it lives
        assert ours.parent == left.parent == place
    assert not ours.exists()
    process.kill()
    process.communicate()
    assert left.exists()
    with runtime_folder() as ours:
        assert [each.name for each in place.iterdir()] == [ours.name]


def test_nothing_else_is_removed(place: Path) -> None:
    others = [place / f"{PREFIX}new", place / "lindy-x", place / "of-somebody"]
    for folder in others:
        folder.mkdir()
    for folder in others[1:]:
        (folder / "file").write_text("kept")
    pointer = place / f"{PREFIX}pointer"
    pointer.symlink_to(others[2])
    (place / f"{PREFIX}file").write_text("kept")
    with runtime_folder() as ours:
        assert {each.name for each in place.iterdir()} == {
            ours.name, f"{PREFIX}new", "lindy-x", "of-somebody", pointer.name, f"{PREFIX}file",
        }  # fmt: skip
    assert (others[2] / "file").read_text() == "kept"
