"""A computer that is too busy for a dive is named once."""

from collections.abc import Sequence

from hypothesis import given
from hypothesis import strategies as st

from messages.health import Health
from services.runtime.launch.busy import Busyness

SECOND = 1_000_000_000


def health(service: str, late_ms: float | None) -> Health:
    return Health(
        stamp_ns=0,
        service=service, loop_hz=100.0, lateness_p50_ms=1.0, lateness_p99_ms=late_ms,
        cpu_percent=None, rss_mb=None, sent=0, received=0, counts={},
    )  # fmt: skip


def said(late: Sequence[tuple[int, str, float | None]]) -> list[str]:
    busy = Busyness()
    found = [busy.see(health(name, ms), at * SECOND, "this") for at, name, ms in late]
    return [sentence for sentence in found if sentence is not None]


def test_many_late_services_at_once_are_one_sentence() -> None:
    late = [(second, f"s{number}", 80.0) for second in range(5) for number in range(13)]
    assert said(late) == [
        "this computer is too busy for a dive: 10 late services in 10 s; try this"
    ]


def test_one_service_that_is_always_late_is_its_own_affair() -> None:
    assert said([(second, "recorder", 900.0) for second in range(100)]) == []


def test_late_services_far_apart_are_no_busy_computer() -> None:
    assert said([(4 * number, f"s{number}", 80.0) for number in range(40)]) == []


@given(
    st.lists(
        st.tuples(st.integers(0, 3), st.sampled_from("abcdefgh"), st.floats(0, 40) | st.none())
    )
)
def test_services_in_time_are_never_named(late: list[tuple[int, str, float | None]]) -> None:
    assert said(sorted(late, key=lambda row: row[0])) == []
