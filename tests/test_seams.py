"""Faults at the seams (tests/long/seams.py): with each of them, a test beside it fails."""

from pathlib import Path

import pytest

from tests.long.mutants import Copy
from tests.long.seams import SEAMS, Seam


@pytest.fixture(scope="module")
def copy(tmp_path_factory: pytest.TempPathFactory) -> Copy:
    return Copy(tmp_path_factory.mktemp("copy"))


@pytest.mark.slow
@pytest.mark.parametrize("seam", SEAMS, ids=lambda seam: seam.name)
def test_no_fault_at_a_seam_goes_unnoticed(copy: Copy, seam: Seam) -> None:
    text = Path(seam.file).read_text(encoding="utf-8")
    assert text.count(seam.before) == 1, f"{seam.file} has changed: {seam.before}"
    fault = text.replace(seam.before, seam.after)
    assert copy.outcome_with(seam.file, fault, seam.tests, "not slow and not system") == "failed"
