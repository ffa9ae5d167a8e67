"""Command line options that several verbs share."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter, Token

from services.runtime.config.errors import LindyError


def named(_: object, tokens: Sequence[Token]) -> Path:
    """A path from the command line. An empty one, such as from an unset shell variable, is refused,
    because it would mean the current folder."""
    if not tokens[0].value:
        raise ValueError("it is empty; name one, such as dives/mine, or . for this folder")
    text = tokens[0].value
    try:
        text.encode()
    except UnicodeEncodeError:
        raise ValueError("it has letters that are not UTF-8") from None
    try:
        return Path(text).expanduser()  # a quoted ~ is left to us by the shell
    except RuntimeError:  # of a user that there is not
        return Path(text)


def whole(_: object, tokens: Sequence[Token]) -> int:
    """A whole number from the command line: 1.5 is refused, not rounded.

    Raises:
        LindyError: it is not a whole number.
    """
    token = tokens[0]
    try:
        return int(token.value)
    except ValueError:
        raise LindyError(
            f"{token.keyword} is {token.value!r}, expected a whole number such as 7"
        ) from None


Whole = Annotated[int, Parameter(converter=whole)]
Json = Annotated[bool, Parameter(name="--json", help="print JSON")]
NewFile = Annotated[Path, Parameter(converter=named, help="the file to write, a new one")]
NewPicture = Annotated[Path | None, Parameter(converter=named, help="also draw into this new PNG")]
RunningDive = Annotated[
    Path | None, Parameter(help="folder of a dive that is going on; default: the newest")
]
Overrides = Annotated[
    tuple[str, ...],
    Parameter(name="--set", help="key.path=value into the vehicle file; repeatable"),
]
VehicleName = Annotated[
    str, Parameter(help="a name in deploy/vehicles, or the path of a TOML file")
]
StackName = Annotated[
    str, Parameter(help="which services: a name in deploy/stacks, or the path of a TOML file")
]
UntilCtrlC = Annotated[
    float | None, Parameter(name="--seconds", help="end after so long; default: Ctrl-C")
]
Router = Annotated[
    str,
    Parameter(
        name=("--router", "--connect"),
        help="endpoint of a router, or of a drone, e.g. tls/192.168.2.2:7447",
    ),
]
KeysFolder = Annotated[
    Path | None,
    Parameter(converter=named, help="folder of the keys; default: ~/.config/lindy/keys"),
]
Insecure = Annotated[bool, Parameter(help="no keys: whoever reaches the port may fly")]
Grouped = Annotated[
    bool,
    Parameter(
        help="few processes instead of one per service, for a small computer: services that have "
        "none of their own in the stack file share one per side",
    ),
]
LinkName = Annotated[str, Parameter(help="a name in deploy/links, or the path of a TOML file")]
Seed = Annotated[Whole, Parameter(help="whole number that everything random follows from")]
HERE = "tcp/127.0.0.1:7447"  # where both sides meet on one machine


DroneName = Annotated[
    str | None,
    Parameter(
        help="name of this drone on the network; default: its type's and this computer's, such as "
        "pioneer-boat"
    ),
]
PilotName = Annotated[
    str | None, Parameter(help="gamepad, keyboard or script:FILE (a CSV stick log)")
]
DiveFolder = Annotated[
    Path | None,
    Parameter(
        converter=named,
        help="folder for the recording; where it holds a dive already, a new one beside it; "
        "default: dives/ and the time (UTC). dives/latest is the newest dive in dives/",
    ),
]


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class Choices:
    """Options that real and simulated dives share."""

    pilot: PilotName = None
    vehicle: VehicleName = "pioneer"
    name: Annotated[str | None, Parameter(parse=False)] = None
    stack: StackName = "simulated"
    link: LinkName = "tether"
    seconds: Annotated[
        float | None,
        Parameter(help="end this long after arming at the latest; a script ends it sooner"),
    ] = None
    out: DiveFolder = None
    seed: Seed = 0
    set_: Overrides = ()


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class NamedChoices(Choices):
    """Options of a dive whose drone has a name on the network."""

    name: DroneName = None


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class ServiceChoices(NamedChoices):
    """Options of one service, which ends with whoever started it."""

    seconds: Annotated[float | None, Parameter(parse=False)] = None


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class FleetChoices(Choices):
    """Options of a topside for a drone of a network, which emulates no link and draws nothing."""

    link: Annotated[str, Parameter(parse=False)] = "tether"
    seconds: Annotated[float | None, Parameter(parse=False)] = None
    seed: Annotated[int, Parameter(parse=False)] = 0


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class ScriptedChoices(Choices):
    """Options of a dive on virtual time, which nobody's hands fly."""

    pilot: Annotated[
        str | None, Parameter(help="script:FILE, a CSV stick log; default: script:first_dive")
    ] = None


SCRIPTED = ScriptedChoices()
NAMED = NamedChoices()
FLEET = FleetChoices()
SERVICE = ServiceChoices()
