"""What is said when something that is waited for does not happen."""

import pytest

from tests.support import patience


def test_what_happens_is_returned_and_what_does_not_is_said_with_the_state_at_the_end(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    seen = list[int]()
    assert patience.until(lambda: seen[2:], meanwhile=lambda: seen.append(len(seen))) == [2]
    monkeypatch.setattr(patience, "PATIENCE_S", 0.02)
    with pytest.raises(AssertionError) as failed:
        patience.until(lambda: len(seen) > 3, lambda: seen)
    assert "not after 0.02 s: patience.until(lambda: len(seen) > 3" in str(failed.value)
    assert str(failed.value).endswith("; [0, 1, 2]")
