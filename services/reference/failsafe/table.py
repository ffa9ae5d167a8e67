"""The failsafe table: what makes the drone act by itself, in which stages, and what ends it.

`docs/failsafes.md` is written from it (`make docs`).
"""

from typing import NamedTuple, get_args

from messages import events
from messages.events import Condition
from messages.vehicle import Reaction
from services.reference.settings import FailsafeSettings

SEVERITY: tuple[Reaction, ...] = get_args(Reaction)  # the mildest first
ACTING: tuple[Reaction, ...] = ("stop", "ascend", "surface")  # they take the sticks from the pilot


SHORT_NS = 2_000_000_000  # [ns] a loss that lasts so long is none that ends by itself


class FailsafeStage(NamedTuple):
    after: float  # [s] since the condition began, without a break
    reaction: Reaction


class FailsafeRow(NamedTuple):
    """What one condition makes the drone do."""

    condition: Condition
    measured: str  # when it holds, and where that is measured; for the documentation
    stages: tuple[FailsafeStage, ...]
    overrule: bool = False  # `resume` is granted although the condition still holds
    brief: bool = False  # after a short one, centred sticks are enough
    told: bool = True  # its beginning is counted and logged here; False: by whoever measures it

    @property
    def name(self) -> str:
        return self.condition.name

    @property
    def acts(self) -> bool:
        """Can it take the sticks from the pilot?"""
        return any(stage.reaction in ACTING for stage in self.stages)


NOTICE, LIMIT, STOP = (
    FailsafeStage(0.0, "notice"),
    FailsafeStage(0.0, "limit"),
    FailsafeStage(0.0, "stop"),
)


def table(s: FailsafeSettings) -> tuple[FailsafeRow, ...]:
    """The rows, the gravest first: of equal reactions the first one is said to act."""
    rises_without_pilot = FailsafeStage(s.pilot_patience, "ascend")
    return (
        FailsafeRow(
            events.LEAK,
            "`sensor/leak` is wet",
            (NOTICE, FailsafeStage(s.leak_patience, "ascend")),
            overrule=True,
        ),
        FailsafeRow(
            events.BATTERY_CRITICAL,
            "`sensor/battery`: charge left at most `battery_critical`",
            (NOTICE, FailsafeStage(s.battery_patience, "ascend")),
            overrule=True,
        ),
        FailsafeRow(
            events.STATE_LOST,
            "no `state` for 0.1 s",
            (STOP,),
            brief=True,
        ),
        FailsafeRow(
            events.IMU_LOST,
            "`state`: roll is not valid",
            (STOP,),
            overrule=True,
        ),
        FailsafeRow(
            events.LINK_LOST,
            "neither sticks nor `clock/ping` for 1 s, after there were pings",
            (STOP, rises_without_pilot),
            brief=True,
        ),
        FailsafeRow(
            events.PILOT_LOST,
            "armed, and the newest `pilot/command` has expired (0.3 s), or its pad is lost",
            (STOP, rises_without_pilot),
            brief=True,
        ),
        FailsafeRow(
            events.DEPTH_LIMIT,
            "the reference comes to rest at `depth_limit`",
            (LIMIT,),
        ),
        FailsafeRow(
            events.TOO_DEEP,
            "`state`: depth more than 0.5 m below `depth_limit`",
            (NOTICE,),
        ),
        FailsafeRow(
            events.FLOOR_LIMIT,
            "the stick points down in a mode that holds the depth, and the reference comes to rest "
            "at `floor_distance`",
            (LIMIT,),
        ),
        FailsafeRow(
            events.NEAR_FLOOR,
            "`sensor/dvl` or `sensor/altitude`: altitude less than `floor_distance`",
            (NOTICE,),
        ),
        FailsafeRow(
            events.DEPTH_LOST,
            "the mode holds the depth, and its estimate is not valid for 0.5 s",
            (NOTICE,),
            told=False,
        ),
        FailsafeRow(
            events.HEADING_LOST,
            "the mode holds the heading, and its estimate is not valid for 0.5 s",
            (NOTICE,),
            told=False,
        ),
        FailsafeRow(
            events.SENSOR_TROUBLE,
            "`state`: troubles, by estimation (silent, noisy, frozen, inconsistent, disturbed)",
            (NOTICE,),
            told=False,
        ),
        FailsafeRow(
            events.CONTROL_SILENT,
            "armed, and no `control/wrench` for 0.5 s",
            (NOTICE,),
        ),
        FailsafeRow(
            events.BOARD_SILENT,
            "`health` of a driver such as ardusub: no heartbeat of the board for 3 s",
            (NOTICE,),
            told=False,
        ),
        FailsafeRow(
            events.SERVICE_SILENT,
            "no `health` of the vehicle side, estimation, control, a module of yours on board or, "
            "where it is another machine, its supervisor for 3 s, after there was some",
            (NOTICE,),
        ),
        FailsafeRow(
            events.SERVICE_LATE,
            "`health` of the vehicle side, estimation, control or a module of yours on board: 1 % "
            "of its messages of a second handled over 40 ms late, in the last 10 s",
            (NOTICE,),
        ),
        FailsafeRow(
            events.RECORDER_DOWN,
            "no `health` of the recorder for 3 s, after there was some",
            (NOTICE,),
        ),
        FailsafeRow(
            events.DISK_FULL,
            "`health` of the recorder: a disk error in the last 10 s",
            (NOTICE,),
            told=False,
        ),
        FailsafeRow(
            events.CLOCK_JUMP,
            "`health` of the link monitor: a jump in the last 10 s",
            (NOTICE,),
            told=False,
        ),
        FailsafeRow(
            events.BATTERY_LOW,
            "`sensor/battery`: charge left at most `battery_low`, and more than `battery_critical`",
            (NOTICE,),
        ),
        FailsafeRow(
            events.TOO_HOT,
            "`sensor/temperature`: at least `hot`",
            (NOTICE,),
        ),
    )
