"""The failsafe table: what makes the drone act by itself, in which stages, and what ends it.

`docs/failsafes.md` is written from it (`make docs`).
"""

from typing import NamedTuple, get_args

from messages.vehicle import Reaction
from services.reference.settings import FailsafeSettings

SEVERITY: tuple[Reaction, ...] = get_args(Reaction)  # the mildest first
ACTING: tuple[Reaction, ...] = ("stop", "ascend", "surface")  # they take the sticks from the pilot


class FailsafeStage(NamedTuple):
    after: float  # [s] since the condition began, without a break
    reaction: Reaction


class Row(NamedTuple):
    """One condition."""

    name: str
    words: str  # what the pilot reads
    measured: str  # when it holds, and where that is measured; for the documentation
    stages: tuple[FailsafeStage, ...]
    overrule: bool = False  # `resume` is granted although the condition still holds
    told: bool = True  # its beginning is counted and logged here; False: by whoever measures it

    @property
    def acts(self) -> bool:
        """Can it take the sticks from the pilot?"""
        return any(stage.reaction in ACTING for stage in self.stages)

    @property
    def ends_by(self) -> str:
        if not self.acts:
            return "the end of the condition"
        return "resume, at any time" if self.overrule else "resume, once the condition has ended"


NOTICE, LIMIT, STOP = (
    FailsafeStage(0.0, "notice"),
    FailsafeStage(0.0, "limit"),
    FailsafeStage(0.0, "stop"),
)


def table(s: FailsafeSettings) -> tuple[Row, ...]:
    """The rows, the gravest first: of equal reactions the first one is said to act."""
    rises_without_pilot = FailsafeStage(s.pilot_patience, "ascend")
    return (
        Row(
            "leak",
            "water in the enclosure",
            "`sensor/leak` is wet",
            (NOTICE, FailsafeStage(s.leak_patience, "ascend")),
            overrule=True,
        ),
        Row(
            "battery_critical",
            "the battery is nearly empty",
            "`sensor/battery`: charge left at most `battery_critical`",
            (NOTICE, FailsafeStage(s.battery_patience, "ascend")),
            overrule=True,
        ),
        Row(
            "state_lost",
            "drone's state lost: its motion is not known",
            "no `state` for 0.1 s",
            (STOP,),
        ),
        Row(
            "imu_lost",
            "the IMU cannot be used: no attitude and heading, depth from pressure alone",
            "`state`: roll is not valid",
            (STOP,),
            overrule=True,
        ),
        Row(
            "link_lost",
            "link lost: nothing arrives from topside",
            "neither sticks nor `clock/ping` for 1 s, after there were pings",
            (STOP, rises_without_pilot),
        ),
        Row(
            "pilot_lost",
            "pilot lost: no stick positions arrive",
            "armed, and the newest `pilot/command` has expired (0.3 s), or its pad is lost",
            (STOP, rises_without_pilot),
        ),
        Row(
            "depth_limit",
            "the depth limit: the drone goes no deeper",
            "the reference comes to rest at `depth_limit`",
            (LIMIT,),
        ),
        Row(
            "too_deep",
            "the drone is deeper than its limit",
            "`state`: depth more than 0.5 m below `depth_limit`",
            (NOTICE,),
        ),
        Row(
            "near_floor",
            "the bottom is close",
            "`sensor/dvl`: altitude less than `floor_distance`",
            (NOTICE,),
        ),
        Row(
            "depth_lost",
            "the depth is not known and not held",
            "the mode holds the depth, and its estimate is not valid for 0.5 s",
            (NOTICE,),
            told=False,
        ),
        Row(
            "heading_lost",
            "the heading is not known and not held",
            "the mode holds the heading, and its estimate is not valid for 0.5 s",
            (NOTICE,),
            told=False,
        ),
        Row(
            "sensor",
            "a sensor cannot be used",
            "`state`: troubles, by estimation (silent, noisy, frozen, distrusted, disturbed)",
            (NOTICE,),
            told=False,
        ),
        Row(
            "thruster",
            "a thruster does not follow its commands",
            "`control/wrench`: distrusted",
            (NOTICE,),
            told=False,
        ),
        Row(
            "control_silent",
            "control does not answer: the thrusters have stopped",
            "armed, and no `control/wrench` for 0.5 s",
            (NOTICE,),
        ),
        Row(
            "board_silent",
            "the vehicle's board does not answer",
            "`health` of ardusub: no heartbeat of the board for 3 s",
            (NOTICE,),
            told=False,
        ),
        Row(
            "service_silent",
            "a service on board does not answer",
            "no `health` of estimation, control or the simulator for 3 s, after there was some",
            (NOTICE,),
        ),
        Row(
            "service_late",
            "a service on board is late",
            "`health` of the simulator, estimation or control: 1 % of its messages of a second "
            "handled over 40 ms late, in the last 10 s",
            (NOTICE,),
        ),
        Row(
            "recorder_down",
            "the recorder does not answer",
            "no `health` of the recorder for 3 s, after there was some",
            (NOTICE,),
        ),
        Row(
            "disk_full",
            "the recording cannot be written to the disk",
            "`health` of the recorder: a disk error in the last 10 s",
            (NOTICE,),
            told=False,
        ),
        Row(
            "clock_jump",
            "a computer's clock has jumped",
            "`health` of the link monitor: a jump in the last 10 s",
            (NOTICE,),
            told=False,
        ),
        Row(
            "battery_low",
            "the battery is low",
            "`sensor/battery`: charge left at most `battery_low`, and more than `battery_critical`",
            (NOTICE,),
        ),
        Row(
            "too_hot",
            "the enclosure is too hot",
            "`sensor/temperature`: at least `hot`",
            (NOTICE,),
        ),
    )
