"""Faults at the seams (tests/long/seams.py): with each of them, a test beside it fails."""

import compileall
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests.long.seams import SEAMS, Seam

PARTS = ("messages", "services", "tools", "lindy", "tests", "deploy", "pyproject.toml")


@pytest.fixture(scope="module")
def copy(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("copy")
    for part in PARTS:
        if Path(part).is_dir():
            ignored = shutil.ignore_patterns("__pycache__", "node_modules")
            shutil.copytree(part, folder / part, ignore=ignored)
        else:
            shutil.copy2(part, folder / part)
    compileall.compile_dir(folder, quiet=2)  # the runs add nothing to it
    return folder


@pytest.mark.slow
@pytest.mark.parametrize("seam", SEAMS, ids=lambda seam: seam.name)
def test_no_fault_at_a_seam_goes_unnoticed(copy: Path, seam: Seam) -> None:
    path, text = copy / seam.file, Path(seam.file).read_text(encoding="utf-8")
    assert text.count(seam.before) == 1, f"{seam.file} has changed: {seam.before}"
    path.write_text(text.replace(seam.before, seam.after), encoding="utf-8")
    try:
        done = subprocess.run(
            [sys.executable, "-m", "pytest", "-x", "-q", "-n", "0", "-p", "no:cacheprovider",
             "-m", "not slow and not system", "--hypothesis-profile", "verdict", *seam.tests],
            cwd=copy,
            env=os.environ | {"PYTHONHASHSEED": "0", "PYTHONDONTWRITEBYTECODE": "1"},
            capture_output=True,
            text=True,
            check=False,
        )  # fmt: skip
    finally:
        path.write_text(text, encoding="utf-8")
    assert done.returncode == 1, done.stdout[-2000:]
