"""When the vehicle is too deep. Pure: no bus and no clock, so that a test needs neither."""

from dataclasses import dataclass

from lindy.api.messages import Estimate

MARGIN = 0.2  # [m] above the limit at which the alarm ends, so that it does not flicker


@dataclass(slots=True)
class DepthAlarm:
    """Fed with every estimate of the depth; `on` says whether the alarm is on."""

    deepest: float  # [m] positive down
    on: bool = False

    def heard(self, depth: Estimate) -> str | None:
        """What people should be told now, or None if nothing has changed. A depth that is not
        valid changes nothing."""
        if not depth.valid:
            return None
        if not self.on and depth.value > self.deepest:
            self.on = True
            return f"too deep: {depth.value:.1f} m, the limit is {self.deepest:.1f} m"
        if self.on and depth.value < self.deepest - MARGIN:
            self.on = False
            return f"above {self.deepest:.1f} m again"
        return None
