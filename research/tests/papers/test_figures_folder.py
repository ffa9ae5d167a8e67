"""Figures are written into a folder without any that is there already."""

from hashlib import sha256
from pathlib import Path

import pytest

from lindy_research.papers import catalogue
from lindy_research.papers.command import figures


def fill(folder: Path, *names: str) -> None:
    folder.mkdir()
    for name in names:
        (folder / name).write_bytes(f"the user's own {name}".encode())


def hashes(folder: Path) -> dict[str, str]:
    files = [path for path in folder.rglob("*") if path.is_file()]
    return {str(p.relative_to(folder)): sha256(p.read_bytes()).hexdigest() for p in files}


def test_figures_of_an_earlier_run_stay(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr(catalogue, "checked_claims", list)
    out = tmp_path / "figures"
    fill(out, "fernandes-3.svg", "thesis.pdf")
    before = hashes(out)
    assert figures(out=out, only=("fernandes-3",)) == 0
    assert hashes(out) == before
    assert f"{out} holds figures already; these go to {out}-2" in capsys.readouterr().out
    assert set(hashes(tmp_path / "figures-2")) == {
        "fernandes-3.png", "fernandes-3.svg", "claims.json",
    }  # fmt: skip
    fill(tmp_path / "mine", "andren-5.1.png")
    before = hashes(tmp_path / "mine")
    assert figures(out=tmp_path / "mine", only=("fernandes-3",)) == 0
    assert before.items() <= hashes(tmp_path / "mine").items()
