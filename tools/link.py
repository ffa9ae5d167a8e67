"""`lindy link`: the tether's model without a network, and the link of a running dive."""

import math
import sys
from pathlib import Path
from typing import Annotated, Literal

from cyclopts import App, Parameter

from messages import topics
from messages.link import LinkRequest
from services.runtime.config.errors import LindyError
from services.runtime.config.running import Running
from tools.choices import RunningDive, Whole

MOST_MESSAGES = 5_000_000

link = App(
    name="link",
    help="Show the model of the tether, or change a running link.",
)


@link.command
def show(
    profile: Annotated[str, Parameter(help="a name in deploy/links, or a TOML file")] = "tether",
    /,
    *,
    hz: Annotated[float, Parameter(help="[1/s] messages that enter, evenly")] = 50.0,
    bytes_: Annotated[Whole, Parameter(name="--bytes", help="size of each message")] = 200,
    seconds: Annotated[float, Parameter(help="how long messages enter")] = 10.0,
    seed: Annotated[Whole, Parameter(help="as of `lindy dive`")] = 0,
    direction: Literal["down", "up"] = "down",
) -> int:
    """Print what the link would do to a stream of messages: seq,sent_s,arrived_s,reason.

    A lost message has a reason and no arrival; a copy has the same seq once more; a damaged one
    arrives, with the reason damaged. The same seed gives the same lines.

    Example: lindy link show severe --hz 100 --bytes 200 --seconds 60 --seed 1
    """
    for name, value in (("hz", hz), ("seconds", seconds)):
        if not (math.isfinite(value) and value > 0.0):
            raise LindyError(f"--{name} is {value:g}, expected a finite number above 0")
    if hz * seconds > MOST_MESSAGES:
        raise LindyError(f"{hz * seconds:.3g} messages are too many; the most is 5e6")
    if bytes_ < 0 or seed < 0:
        raise LindyError("--bytes and --seed are whole numbers from 0")
    from services.tether.io.profile_file import named
    from services.tether.link_model import fates

    found = named(profile).profile
    leg = found.down if direction == "down" else found.up
    rows = fates(leg, hz, bytes_, seconds, seed + (direction == "up"))
    lines = (f"{n},{sent:.6f},{_seconds(at)},{why}\n" for n, sent, at, why in rows)
    sys.stdout.write("seq,sent_s,arrived_s,reason\n" + "".join(lines))
    return 0


@link.command(name="set")
def set_(*settings: str, dive: RunningDive = None) -> int:
    """Change the link of a dive that is going on: another profile, single keys of it, down or up.

    A profile is a name in deploy/links, or a TOML file; nothing on the way is lost. Over one that
    cannot be flown the drone loses its pilot, which is printed. `down` cuts the link, and whatever
    is on the way is lost; `up` joins it again.

    Example: lindy link set congested
             lindy link set up.delay_ms=80 down.rate_kbit=256
             lindy link set down
    """
    name = settings[0] if len(settings) == 1 and "=" not in settings[0] else None
    match name:
        case None:
            return _ask(LinkRequest(stamp_ns=0, id="", kind="set", settings=settings), dive)
        case "down" | "up":
            return _ask(LinkRequest(stamp_ns=0, id="", kind=name), dive)
        case _:
            status = _ask(LinkRequest(stamp_ns=0, id="", kind="profile", profile=name), dive)
            if (why := _why_not_flown(name)) is not None:
                print(f"the drone loses its pilot by it: {why}", file=sys.stderr, flush=True)
            return status


def _ask(request: LinkRequest, dive: Path | None) -> int:
    from tools.ask import answer_to, at_once, dive_in

    running = dive_in(dive)
    require_link(running)
    answer = answer_to(
        lambda node: at_once(node, request, topics.LINK_REQUEST, topics.LINK_ANSWER),
        running,
        "tether",
    )
    if not answer.accepted:
        raise LindyError(f"the tether refuses: {answer.reason}")
    print(answer.change)
    return 0


def require_link(running: Running) -> None:
    """Raises LindyError: there is no emulated link among the processes of a dive."""
    from services.runtime.launch.process_plan import HOME

    if "tether" in running.pids:
        return
    if HOME not in running.endpoints:
        raise LindyError(
            "the drone's side has no emulated link; ask in the topside's folder, if the topside "
            "was started with --gateway"
        )
    raise LindyError("this dive has no emulated link; start the topside with --gateway")


def _why_not_flown(name: str) -> str | None:
    from services.tether.io.profile_file import named
    from tools.link_fit import why_not_flown

    try:
        return why_not_flown(named(name))
    except LindyError:  # a file that only the tether's machine has
        return None


def _seconds(at: float | None) -> str:
    return "" if at is None else f"{at:.6f}"
