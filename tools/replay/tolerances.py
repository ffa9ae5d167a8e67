"""Which differences between a recording and today's output are none."""

from collections.abc import Sequence

from services.runtime.config.errors import LindyError
from tools.replay.differences import Tolerance

ANY = float("inf")
# A recording of the real clock does not say when exactly a handler was called: the service is
# stepped at the stamps of its own recorded messages, but a timer rings at its nominal instant.
# What follows from the load of that computer is not compared at all.
REAL_TIME = (
    Tolerance("health/*", absolute=ANY),
    Tolerance("identity/*", absolute=ANY),  # version and commit are today's
    Tolerance("*.seq", absolute=ANY),
    Tolerance("*.epoch"),  # numbers of leases, large as they are
    Tolerance("*_ns", absolute=50e6),  # [ns] a timer rang, or a command came, just before or after
    Tolerance("*_age_ms", absolute=50.0),  # [ms]
    Tolerance("control/*", absolute=0.1, relative=0.01),  # [N, N m]
    Tolerance("state.*", absolute=3e-3, relative=3e-3),  # [m, rad, m/s …]
    Tolerance("reference.*", absolute=1e-3, relative=1e-3),  # [m, rad, m/s …]
)
# Share of a topic's messages in which a field of a real-time recording may differ all the same, and
# how many always may: two messages that arrived together may have been handled in another order.
RARELY, A_FEW = 0.01, 3
# Where the link damaged messages, the recorder heard that there were some, and not what they were.
DAMAGED = (
    Tolerance("health/*.counts.malformed:*", absolute=ANY),
    Tolerance("health/*.received", absolute=ANY),
    Tolerance("health/*.loop_hz", absolute=ANY),
    Tolerance("health/*.lateness_*", absolute=ANY),
)
# The same input is the same output; only the version is today's.
VIRTUAL = (Tolerance("identity/*.version", absolute=ANY),)


def parsed(texts: Sequence[str]) -> tuple[Tolerance, ...]:
    """`TOPIC.FIELD=NUMBER` as the user writes it; * for anything in the name, % behind a relative
    one.

    Raises:
        LindyError: not of that form, or not a number from 0.
    """
    found: list[Tolerance] = []
    for text in texts:
        pattern, equals, number = text.rpartition("=")
        try:
            value = float(number.removesuffix("%"))
        except ValueError:
            value = -1.0
        if not pattern or not equals or not value >= 0.0:
            raise LindyError(
                f"--tolerance {text}: expected TOPIC.FIELD=NUMBER, such as state.depth.*=1e-6 or "
                f"control/wrench.*=1%"
            )
        is_share = number.endswith("%")
        found.append(
            Tolerance(pattern, relative=value / 100.0)
            if is_share
            else Tolerance(pattern, absolute=value)
        )
    return tuple(found)
