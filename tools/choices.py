"""Command line options that `dive`, `up`, `simulate` and `run` share."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter, Token

from tools.whole import Whole


def named(_: object, tokens: Sequence[Token]) -> Path:
    """A path from the command line. An empty one, such as from an unset shell variable, is refused,
    because it would mean the current folder."""
    if not tokens[0].value:
        raise ValueError("it is empty; name one, such as dives/mine, or . for this folder")
    return Path(tokens[0].value)


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class Choices:
    """Options that real and simulated dives share."""

    pilot: Annotated[
        str | None, Parameter(help="gamepad, keyboard or script:FILE (a CSV stick log)")
    ] = None
    vehicle: Annotated[
        str, Parameter(help="a name in deploy/vehicles, or the path of a TOML file")
    ] = "pioneer"
    name: Annotated[
        str | None,
        Parameter(
            help="of this drone on the network; default: its file's and this computer's, such as "
            "pioneer-boat; in virtual time its file's"
        ),
    ] = None
    stack: Annotated[
        str,
        Parameter(help="which services: a name in deploy/stacks, or the path of a TOML file"),
    ] = "simulated"
    link: Annotated[str, Parameter(help="a name in deploy/links, or the path of a TOML file")] = (
        "tether"
    )
    seconds: Annotated[
        float | None, Parameter(help="end this long after arming, whatever the pilot does")
    ] = None
    out: Annotated[
        Path | None,
        Parameter(
            converter=named,
            help="folder for the recording; where it holds a dive already, a new one beside it; "
            "default: dives/ and the time (UTC). dives/latest is the newest dive in dives/",
        ),
    ] = None
    seed: Annotated[Whole, Parameter(help="of everything random in simulator and link")] = 0
    set_: Annotated[
        tuple[str, ...],
        Parameter(
            name="--set", negative=(), help="key.path=value into the vehicle file; repeatable"
        ),
    ] = ()
