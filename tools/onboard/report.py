"""Sums up a dive of the drone's side that is over: `python -m tools.onboard.report DESCRIPTOR`."""

import sys

from services.runtime.config.errors import LindyError
from tools.exit_status import ERROR
from tools.live.outcome import RECORDER, Outcome
from tools.live.stop_signals import StopSignals
from tools.onboard.plan import DiveEnd, handed_on
from tools.report import Elsewhere


def report(end: DiveEnd) -> int:
    """Returns the exit status, as `Outcome.sum_up`.

    Raises:
        LindyError: why the dive was aborted, or why there is no report.
    """
    dive, seen = end.dive, end.seen
    outcome = Outcome(dive.stack)
    outcome.exit, outcome.gone = seen.exit, seen.gone
    outcome.restarts, outcome.hung = lambda: seen.restarts, lambda: seen.hung
    outcome.shared = dive.services.shared
    outcome.take_over(seen.health, armed=seen.armed)
    with StopSignals() as stop:
        if RECORDER in dive.services:
            topside = Elsewhere("topside", dive.elsewhere)
            return stop.report(lambda: outcome.sum_up(topside))
        return stop.report(
            lambda: outcome.sum_up_unrecorded("drone", "topside"),
            "the recording is on the topside's side",
        )


def main() -> int:
    try:
        return report(handed_on(DiveEnd))
    except LindyError as error:
        print(f"lindy: {' '.join(str(error).split())}", file=sys.stderr, flush=True)
        return ERROR


if __name__ == "__main__":
    sys.exit(main())
