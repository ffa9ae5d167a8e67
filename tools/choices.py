"""What `dive` and `simulate` are told on the command line."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter


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
        Path | None, Parameter(help="folder for the recording; default: dives/ and the time (UTC)")
    ] = None
    seed: Annotated[int, Parameter(help="of everything random in simulator and link")] = 0
    set_: Annotated[
        tuple[str, ...],
        Parameter(
            name="--set", negative=(), help="key.path=value into the vehicle file; repeatable"
        ),
    ] = ()
