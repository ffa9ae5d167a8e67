"""`lindy review` on a dive of ours and on a log of another program."""

import json
import shutil
from collections import Counter
from pathlib import Path
from typing import Any

import msgspec
import pytest

from messages import topics
from services.runtime.config.errors import LindyError
from tests.tools.importing.logs import dataflash
from tools.importing.command import import_log
from tools.replay.source import open_source
from tools.review.command import Review, review, reviewed
from tools.review.estimated import estimate
from tools.review.recorded import read
from tools.review.section import ReviewSection

ROOT = Path(__file__).parents[3]
SECONDS = 12.0


@pytest.fixture(scope="module")
def dive(whole_dive: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A copy, which pages are written beside."""
    return Path(shutil.copytree(whole_dive, tmp_path_factory.mktemp("review") / "dive"))


@pytest.mark.slow
def test_the_estimator_runs_as_it_ran_in_the_dive(dive: Path) -> None:
    found, recorded = estimate(open_source(dive)).track, read(dive).own
    assert found is not None
    assert recorded is not None
    for name in ("roll", "depth", "heading", "surge"):
        ours, theirs = found.known(name)[1], recorded.known(name)[1]
        assert len(ours) > 500
        assert ours.tolist() == theirs.tolist()


@pytest.mark.slow
def test_a_page_that_loads_nothing_and_overwrites_nothing(
    dive: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (dive / "review.html").write_text("an earlier one")
    assert review(dive) == 0
    assert (dive / "review.html").read_text() == "an earlier one"
    assert "review-2.html" in capsys.readouterr().out
    first = (dive / "review-2.html").read_text()
    for section in ReviewSection.__subclasses__():
        assert section.heading in first.replace("&#x27;", "'")
    assert "The same figures: lindy review --json" in first
    assert "http" not in first
    assert first.count("<img") == first.count('src="data:image/png;base64,')
    assert first.count("<img") >= 3
    with pytest.raises(LindyError, match="exists already"):
        review(dive, out=dive / "review.html")


@pytest.mark.slow
def test_the_same_figures_as_json(dive: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pages = sorted(dive.glob("*.html"))
    assert review(dive, json=True) == 0
    found = msgspec.json.decode(capsys.readouterr().out, type=Review, strict=True)
    assert found.imported_from == ""
    assert {each.key for each in found.sensors} >= {topics.IMU.key, topics.PRESSURE.key}
    assert found.estimation.runs
    assert max(each.rms for each in found.estimation.beside) == 0.0
    assert found.seconds == pytest.approx(SECONDS, abs=0.2)
    assert set(found.missing) <= {section.key for section in ReviewSection.__subclasses__()}
    assert sorted(dive.glob("*.html")) == pages


def test_a_log_of_another_program_is_imported_beside_it(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    log = dataflash(tmp_path / "00000042.BIN")
    before = log.read_bytes()
    for folder in ("00000042-lindy", "00000042-lindy-2"):
        assert review(log, json=True) == 0
        printed = capsys.readouterr()
        assert f"{tmp_path / folder}" in printed.err
        found = json.loads(printed.out)
        assert found["imported_from"] == "00000042.BIN"
        assert (tmp_path / folder / "dive.mcap").exists()
        # Four seconds: it lacks nearly everything, and says so.
        assert {"vibration", "measurements"} <= set(found["missing"])
        assert "never got beyond calibrating" in found["missing"]["estimation"][0]
    assert log.read_bytes() == before


def test_the_short_version_is_in_words(tmp_path: Path, dive: Path) -> None:
    folder = tmp_path / "log"
    import_log(dataflash(tmp_path / "00000042.BIN"), map_=None, out=folder, vehicle=None)
    could = "By its sensors Lindy could have flown it"  # of thrusters and sticks nothing is said
    for recording, verdict in ((folder, "could not have flown it"), (dive, could)):
        found = reviewed(recording)
        lines = found.short
        assert lines[0].startswith(f"The dive: {found.figures.seconds:.0f} s")
        assert verdict in lines[1]
        said = " ".join(lines)
        assert not [odd for odd in (".;", "..", "sensor/", "_") if odd in said]
        assert said.count("no sticks") <= 1


@pytest.mark.slow
def test_a_recording_that_is_cut_off_is_reviewed_as_far_as_it_goes(
    dive: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    whole = (dive / "dive.mcap").read_bytes()
    (tmp_path / "cut.mcap").write_bytes(whole[: len(whole) * 2 // 3])
    assert review(tmp_path / "cut.mcap") == 3
    printed = capsys.readouterr().out
    (remark,) = [
        line for line in printed.splitlines() if "cut.mcap" in line and "written" not in line
    ][:1]
    assert remark.replace("'", "&#x27;") in (tmp_path / "review.html").read_text()


@pytest.mark.slow
def test_each_file_of_the_dive_is_opened_at_most_twice(
    dive: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    opened: Counter[Path] = Counter()
    real: Any = Path.open

    def counted(self: Path, *args: Any, **more: Any) -> Any:
        opened[self] += self.suffix == ".mcap" and self.parent == dive
        return real(self, *args, **more)

    monkeypatch.setattr(Path, "open", counted)
    assert review(dive, json=True) == 0
    assert 1 <= max(opened.values()) <= 2


def test_bad_input_is_one_sentence(
    dive: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(LindyError, match=r"ends in \.html"):
        review(dive, out=tmp_path / "page.pdf")
    with pytest.raises(LindyError, match="is a recording already"):
        review(dive, map_="rovio")
    (tmp_path / "README.md").write_text("no log")
    with pytest.raises(LindyError, match=r"README\.md"):
        review(tmp_path / "README.md")
    assert capsys.readouterr() == ("", "")
    (tmp_path / "README.md").unlink()
    with pytest.raises(LindyError, match="there is no file"):
        review(tmp_path / "nothing.bin")
    with pytest.raises(LindyError, match=r"nothing\.mcap"):
        review(tmp_path / "nothing.mcap")
    with pytest.raises(LindyError, match="kelvin"):
        review(dive, json=True, set_=("estimation.kelvin=3",))
    assert list(tmp_path.iterdir()) == []


def test_every_key_of_the_json_is_documented() -> None:
    page = (ROOT / "docs" / "recordings.md").read_text(encoding="utf-8")
    structs: list[type[msgspec.Struct]] = [Review]
    seen: set[str] = set()
    while structs:
        for field in msgspec.structs.fields(structs.pop()):
            seen.add(field.name)
            parts = (field.type, *getattr(field.type, "__args__", ()))
            structs.extend(
                p for p in parts if isinstance(p, type) and issubclass(p, msgspec.Struct)
            )
    assert len(seen) > 40
    assert sorted(name for name in seen if f"`{name}`" not in page) == []
