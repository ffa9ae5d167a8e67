"""Messages that a router left out because its link has little room: `downsampling` in
deploy/router.json5.

No router says what it leaves out, but it does so evenly: it sends a message once 40 ms have passed
since the one before. So of a stream of 100 a second every fourth or fifth comes, and never two in
a row, for as long as the stream lasts. Losses by chance are not so even: where they are as many,
five of six at most, two messages in a row come within any hundred, but for once in 80 million.
"""

from collections.abc import Sequence

from messages.topics import THIN_HZ
from tools.log.numbering import Gap

LEAST = 100  # gaps, each behind the one before: four seconds of a stream that is thinned
# Of the even step from message to message: a busy computer sends them unevenly.
FEWEST, MOST_MEAN, MOST = 0.75, 1.5, 1.75


def thinned(gaps: Sequence[Gap], hz: float) -> int:
    """How many of the missing messages a router left out. Of a longer gap in a thinned stream, only
    so many as thinning explains.

    Args:
        gaps: of one stream.
        hz: its rate.
    """
    even = hz / THIN_HZ
    return sum(
        min(gap.missing, round(MOST * even) - 1)
        for run in _runs(gaps)
        if len(run) >= LEAST
        and even > 1.0
        and FEWEST * even <= 1.0 + sum(gap.missing for gap in run) / len(run) <= MOST_MEAN * even
        for gap in run
    )


def _runs(gaps: Sequence[Gap]) -> list[list[Gap]]:
    """Gaps that follow each other, with one message between two."""
    runs: list[list[Gap]] = []
    for gap in gaps:
        if runs and gap.missing and gap.after_ns == runs[-1][-1].before_ns:
            runs[-1].append(gap)
        elif gap.missing:
            runs.append([gap])
    return runs
