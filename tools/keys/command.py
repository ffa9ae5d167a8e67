"""`lindy keys`: keys for machines that meet over a network."""

from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import App, Parameter

from services.runtime.config.errors import LindyError
from tools.choices import Whole, named
from tools.keys.credentials import CRYPTOGRAPHY, DEFAULT, Identity, parse
from tools.packages import require_package

if TYPE_CHECKING:
    from tools.keys.authority import KeyAuthority

TWO_YEARS = 730  # [days]
Keys = Annotated[Path, Parameter(name="--keys", converter=named, help="the folder of the keys")]
keys = App(name="keys", help="Make and revoke the keys by which drone and pilot know each other.")


@keys.command
def new(
    drone: Annotated[str, Parameter(help="name of the drone")] = "pioneer",
    pilot: Annotated[str, Parameter(help="name of the pilot")] = "first",
    /,
    *,
    folder: Keys = Path(DEFAULT),
) -> int:
    """Make an authority, and keys for one drone and one pilot.

    Example: lindy keys new pioneer ann
    """
    both, authority = (_who(f"drone:{drone}"), _who(f"pilot:{pilot}")), _authority(folder)
    now = datetime.now(UTC)
    authority.make(now)
    print(f"{authority.home}: whoever has it can make keys; keep it at home")
    for who in both:
        made, _ = authority.add(who, now, TWO_YEARS)
        print(f"{made}: copy it into {DEFAULT} of {_machine(who)}")
    return 0


@keys.command
def add(
    role: str,
    name: str,
    /,
    *,
    again: Annotated[bool, Parameter(help="renew a certificate that ends; the key stays")] = False,
    folder: Keys = Path(DEFAULT),
    days: Annotated[Whole, Parameter(help="how long the certificate is valid")] = TWO_YEARS,
) -> int:
    """Make keys for one more. ROLE is drone, pilot, router, or observer (hears, sends nothing).

    Needs the authority; --again needs the folder of somebody's keys beside it, too.

    Example: lindy keys add pilot bob
             lindy keys add pilot ann --again
    """
    who, authority = _who(f"{role}:{name}"), _authority(folder)
    if again:
        made = authority.renew(who, datetime.now(UTC), days)
        where = f"{DEFAULT}/{who.folder} of {_machine(who)}"
        print(f"{made}: copy it into {where}, and start that again")
        return 0
    made, lists = authority.add(who, datetime.now(UTC), days)
    print(f"{made}: copy it into {DEFAULT} of {_machine(who)}")
    for path in lists:
        print(f"{path} names {who} now: copy it to its machine, and start that again")
    return 0


@keys.command(name="list")
def list_(*, folder: Keys = Path(DEFAULT)) -> int:
    """Print whose keys are in the folder, and until when they are valid.

    Example: lindy keys list
    """
    require_package(*CRYPTOGRAPHY)
    from tools.keys.authority import listed
    from tools.keys.certificates import day

    found = listed(folder.expanduser(), datetime.now(UTC))
    width = max(len(str(certificate.who)) for certificate, _, _ in found)
    for (who, begins, ends), state, _ in found:
        print(f"{who!s:<{width}}  {day(begins)} to {day(ends)}  {state}")
    return 0


@keys.command
def revoke(name: str, /, *, folder: Keys = Path(DEFAULT)) -> int:
    """Take somebody, such as pilot:ann, off every list in the folder of the keys.

    A drone reads its list when it is started. So do this on the drone, or copy the list there.

    Example: lindy keys revoke pilot:ann
    """
    who, authority = _who(name), _authority(folder)
    lists = authority.revoke(who)
    for path in lists:
        print(f"{path} does not name {who} any more: copy it to its machine, and start that again")
    if not lists:
        print(f"{who} is revoked; it was on no list in {authority.keys}")
    return 0


def _authority(folder: Path) -> "KeyAuthority":
    require_package(*CRYPTOGRAPHY)
    from tools.keys.authority import KeyAuthority

    return KeyAuthority(folder.expanduser())


def _who(name: str) -> Identity:
    try:
        return parse(name)
    except ValueError as error:
        raise LindyError(str(error)) from None


def _machine(who: Identity) -> str:
    on_board = who.role in ("drone", "router")
    return f"the {who.role} {who.name}" if on_board else f"{who.name}'s computer"
