"""The verb that plays a recorded dive again."""

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from services.runtime.config.errors import LindyError
from tools.choices import named


def replay(
    recording: Annotated[Path, Parameter(converter=named)],
    *,
    speed: Annotated[float, Parameter(help="recorded seconds per second")] = 1.0,
    loop: Annotated[
        bool, Parameter(negative=(), show_default=False, help="over and over, until Ctrl-C")
    ] = False,
    from_: Annotated[
        float | None, Parameter(name="--from", help="[s] since the recording began")
    ] = None,
    to: Annotated[float | None, Parameter(help="[s] since the recording began")] = None,
    topics: Annotated[
        tuple[str, ...],
        Parameter(
            negative=(),
            show_default=False,
            help="only these, such as state or 'sensor/*'; repeatable",
        ),
    ] = (),
    connect: Annotated[
        str | None,
        Parameter(help="play to a hub that is running, e.g. tcp/127.0.0.1:7449; not a vehicle's"),
    ] = None,
    listen: Annotated[
        str | None, Parameter(help="endpoint for other programs, e.g. tcp/127.0.0.1:7449")
    ] = None,
    headless: Annotated[
        bool,
        Parameter(negative=(), show_default=False, help="no viewer, even where there is a display"),
    ] = False,
    through: Annotated[
        tuple[str, ...],
        Parameter(
            negative=(),
            show_default=False,
            help="with --diff: feed the recorded inputs of this service to today's code; "
            "repeatable: together, on one side",
        ),
    ] = (),
    diff: Annotated[
        bool,
        Parameter(
            negative=(),
            show_default=False,
            help="with --through: compare its outputs with the recorded ones; exit status 1 where "
            "they differ",
        ),
    ] = False,
    tolerance: Annotated[
        tuple[str, ...],
        Parameter(
            negative=(),
            show_default=False,
            help="TOPIC.FIELD=NUMBER or NUMBER% that may differ, * for any; repeatable",
        ),
    ] = (),
    stack: Annotated[
        str, Parameter(help="the stack of the dive, for services of your own")
    ] = "simulated",
    set_: Annotated[
        tuple[str, ...],
        Parameter(
            name="--set",
            negative=(),
            show_default=False,
            help="with --through: key.path=value into the recorded vehicle file; repeatable",
        ),
    ] = (),
) -> int:
    """Play a recorded dive again, in its own time; or compare what today's code makes of it.

    RECORDING is a dive's folder or its MCAP file. On a terminal: space pauses, left and right jump
    by 5 s, down and up by 30 s, q ends. A replay has keys of its own: nothing in it reaches a
    vehicle.

    Example: lindy replay dives/latest --from 30 --speed 4
             lindy replay dives/latest --through control --diff
    """
    from tools.replay.command import compare, play

    if bool(through) != diff:
        raise LindyError("--through SERVICE and --diff go together: one is missing")
    if through:
        return compare(
            recording,
            through,
            begin_s=from_,
            end_s=to,
            tolerances=tolerance,
            overrides=set_,
            stack_file=stack,
        )
    if tolerance or set_:
        raise LindyError("--tolerance and --set are for --through SERVICE --diff")
    return play(
        recording,
        speed=speed,
        loop=loop,
        begin_s=from_,
        end_s=to,
        patterns=topics,
        connect=connect,
        listen=listen,
        headless=headless,
    )
