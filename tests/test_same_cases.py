"""Two runs of a property test draw the same cases."""

import sys
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

Case = tuple[int, float, str]


def drawn() -> list[Case]:
    cases = list[Case]()

    @settings(max_examples=200)
    @given(st.integers(), st.floats(allow_nan=False), st.text())
    def collect(number: int, size: float, text: str) -> None:
        cases.append((number, size, text))

    collect()
    return cases


@pytest.mark.skipif(not settings().derandomize, reason="cases are to differ")
def test_whatever_was_imported_before(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    first = drawn()
    path = tmp_path / "fresh_constants.py"
    path.write_text("NUMBER, SIZE, TEXT = 987_654_321, 0.123454321, 'never seen'\n")
    spec = spec_from_file_location(path.stem, path)
    assert spec is not None
    module = module_from_spec(spec)
    monkeypatch.setitem(sys.modules, path.stem, module)
    assert drawn() == first
