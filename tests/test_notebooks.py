"""The notebooks of examples/notebooks: every cell runs, from the first to the last."""

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from tests.support.patience import PATIENCE_S

NOTEBOOKS = sorted((Path(__file__).parents[1] / "examples/notebooks").glob("*.ipynb"))
MAKES = {
    "many_dives": ["dives.parquet", "dives.pdf"],
    "own_controller": ["controllers.png"],
    "own_estimator": ["estimators.png"],
    "own_law": ["laws.png"],
}
SEEDS = ("1..10", "1..2")  # fewer dives than a reader flies


def cells(path: Path, kind: str) -> list[dict[str, Any]]:
    return [c for c in json.loads(path.read_text("utf-8"))["cells"] if c["cell_type"] == kind]


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_carries_no_output(path: Path) -> None:
    for cell in cells(path, "code"):
        assert (cell["outputs"], cell["execution_count"]) == ([], None)
    assert len(cells(path, "markdown")) > 0


@pytest.mark.slow
@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_every_cell_of_a_notebook_runs(path: Path, tmp_path: Path) -> None:
    pytest.importorskip("pandas", reason="pandas is not installed")
    program = "\n\n".join("".join(cell["source"]) for cell in cells(path, "code"))
    (tmp_path / "cells.py").write_text(program.replace(*SEEDS), encoding="utf-8")
    done = subprocess.run(
        [sys.executable, "cells.py"], cwd=tmp_path, capture_output=True, text=True,
        timeout=5.0 * PATIENCE_S, check=False, env={"MPLBACKEND": "Agg", "HOME": str(tmp_path)},
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert all((tmp_path / name).stat().st_size > 1000 for name in MAKES[path.stem])
