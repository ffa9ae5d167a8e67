"""`lindy figures`: every figure is there, says what it shows, and is the same on every run."""

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from lindy.api import LindyError
from lindy_research.papers import catalogue, style
from lindy_research.papers.catalogue import FIGURES, CatalogueEntry, drawn
from lindy_research.papers.claims import Claim
from lindy_research.papers.claims_fernandes_loop import FLOWN
from lindy_research.papers.claims_rule import rule_claims
from lindy_research.papers.command import figures

pytestmark = pytest.mark.slow

ANDREN = ("4.2", "4.3", "5.1", "5.2", "5.3", "5.4", "5.5", "5.6", "5.7", "5.8", "5.9")
FERNANDES = (1, 3, 4, 5, 9, 10, 11, 12, 13, 18)
# Those of flights take a minute to fly and have tests of their own; of those with dives and long
# links tests/wheel/test_research.py draws one.
LONG = ("energy-dive", "link-profiles", "observer-depth", "observer-heading")
UNFLOWN = [
    each
    for each in FIGURES
    if each.id not in LONG and not any(each.id in what.figures for what in FLOWN)
]
PNG = b"\x89PNG\r\n\x1a\n"


def test_every_figure_about_references_is_in_the_catalogue() -> None:
    wanted = {f"andren-{n}" for n in ANDREN} | {f"fernandes-{n}" for n in FERNANDES}
    assert wanted <= {each.id for each in FIGURES}
    assert len({each.id for each in FIGURES}) == len(FIGURES)


@pytest.mark.parametrize("each", UNFLOWN, ids=lambda each: each.id)
def test_a_figure_names_its_source_axes_and_units_and_every_curve_is_finite(
    each: CatalogueEntry,
) -> None:
    figure = drawn(each)
    assert figure.get_suptitle().startswith(each.source)
    assert len(figure.get_supxlabel()) > 60  # the caption
    panels = figure.axes
    assert any("[" in panel.get_xlabel() for panel in panels)
    for panel in panels:
        assert re.search(r"\[.+\]|h_i|functions", panel.get_ylabel()), each.id
    assert any(panel.get_legend() for panel in panels) or each.id == "fernandes-9"
    for panel in panels:
        assert panel.lines
        for line in panel.lines:
            x, y = np.asarray(line.get_xdata(), float), np.asarray(line.get_ydata(), float)
            assert len(x) > 0
            assert np.isfinite(x).all()
            assert np.isfinite(y).all()


def test_two_processes_draw_the_same_bytes(tmp_path: Path) -> None:
    code = (
        "import sys; from pathlib import Path; from lindy_research.papers import catalogue, style;"
        "each = next(e for e in catalogue.FIGURES if e.id == 'andren-5.9');"
        "style.save(catalogue.drawn(each), Path(sys.argv[1]))"
    )
    again = [sys.executable, "-c", code, str(tmp_path / "again")]
    subprocess.run(again, check=True, env={**os.environ, "PYTHONHASHSEED": "2"})
    style.save(drawn(next(each for each in FIGURES if each.id == "andren-5.9")), tmp_path / "first")
    for kind in ("png", "svg"):
        first, again = (tmp_path / f"{name}.{kind}" for name in ("first", "again"))
        assert first.read_bytes() == again.read_bytes()
    assert (tmp_path / "first.png").read_bytes().startswith(PNG)
    assert b"<dc:date>" not in (tmp_path / "first.svg").read_bytes()


def test_the_verb_draws_what_is_asked_for_and_checks_claims(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """All 136 of them: tests/wheel/test_research.py."""
    monkeypatch.setattr(catalogue, "CLAIMS", (rule_claims,))
    out = tmp_path / "made" / "here"
    assert figures(out=out, only=("andren-5.1", "fernandes-3")) == 0
    names = {path.name for path in out.iterdir()}
    pictures = {f"{id_}.{kind}" for id_ in ("andren-5.1", "fernandes-3") for kind in ("png", "svg")}
    assert names == pictures | {"claims.json"}
    claims = json.loads((out / "claims.json").read_text(encoding="utf-8"))
    shown = capsys.readouterr().out
    holding = sum(claim["verdict"] == "holds" for claim in claims)
    differing = sum(claim["verdict"] == "differs" for claim in claims)
    assert f"claims: {holding} hold, {differing} differ" in shown
    assert f"{len(claims) - holding - differing} of flights not computed" in shown
    assert shown.index("[1/2]") < shown.index("[2/2]") < shown.index("claims:")
    for claim in claims:
        assert set(claim) == set(Claim.__struct_fields__)
        assert (f"  {claim['id']} " in shown) == (claim["verdict"] == "differs")


def test_an_unknown_figure_is_refused_before_anything_is_written(tmp_path: Path) -> None:
    with pytest.raises(LindyError, match=r"unknown figure 'andren-5\.11'; did you mean 'andren-5"):
        figures(out=tmp_path / "out", only=("andren-4.2", "andren-5.11"))
    assert not (tmp_path / "out").exists()
