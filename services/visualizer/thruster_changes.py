"""How often the thrusters start and reverse: in the last minute, all together."""

from collections import deque
from collections.abc import Sequence
from typing import Any

from services.visualizer.batch import CurveColumns
from services.visualizer.curve import AXES, Look

WINDOW = 60  # [s]
SECOND = 1_000_000_000  # [ns]
LOOK = Look("thruster_changes", ("starts", "reversals"), (AXES[1], AXES[3]), 2.0)


class ThrusterChanges:
    """Counts as the report does. A start: from no thrust to some. A reversal: some thrust in
    the other direction than the last. Kept are the counts of each second of the last minute."""

    def __init__(self) -> None:
        self._thrust: Sequence[float] | None = None  # [N] of the newest command
        self._ahead: dict[int, bool] = {}  # the direction in which each thruster turned last
        self._second: int | None = None  # that is being counted, since the dive began
        self._counts = deque([[0, 0]], maxlen=WINDOW)  # starts and reversals of each second

    def hear(self, messages: Sequence[Any], times: Sequence[int]) -> CurveColumns | None:
        """A point for each second that has ended; `times` [ns] since the dive began."""
        points = list[tuple[int, Sequence[float]]]()
        for message, time in zip(messages, times, strict=True):
            second = time // SECOND
            if self._second is not None and second > self._second:
                points.append(
                    (time, [float(sum(kind)) for kind in zip(*self._counts, strict=True)])
                )
                for _ in range(min(second - self._second, WINDOW)):
                    self._counts.append([0, 0])
            self._second = second
            self._count(message.thrust)
        if not points:
            return None
        return CurveColumns(LOOK.path, [time for time, _ in points], [row for _, row in points])

    def _count(self, thrust: Sequence[float]) -> None:
        now = self._counts[-1]
        before, self._thrust = self._thrust, thrust
        for k, newton in enumerate(thrust):
            if newton == 0.0:
                continue
            now[0] += before is not None and before[k] == 0.0
            now[1] += self._ahead.get(k, newton > 0.0) != (newton > 0.0)
            self._ahead[k] = newton > 0.0
