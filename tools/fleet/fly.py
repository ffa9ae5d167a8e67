"""`lindy fly NAME`: the topside for one drone of several."""

from dataclasses import replace
from pathlib import Path

from services.runtime.bus.spaces import checked_name
from services.runtime.config.errors import LindyError
from tools.choices import Choices
from tools.fleet.look import is_there, who_is_there
from tools.fleet.names import missing
from tools.keys.door import door
from tools.up import up


def fly(
    name: str,
    choices: Choices,
    *,
    router: str,
    grouped: bool,
    keys: Path | None = None,
    insecure: bool = False,
) -> int:
    """Returns the exit status, as `up`.

    Raises:
        LindyError: no drone of this name is there, or as `up`.
    """
    if choices.name not in (None, name):
        raise LindyError(f"fly {name} --name {choices.name}: the drone's name is said once")
    checked_name(name, "fly")
    way = door(router, "--router", ("pilot",), keys, insecure=insecure)
    own_keys = None if way is None else way.keys
    if not is_there(name, router, own_keys):
        raise LindyError(missing(name, who_is_there(router, own_keys), router))
    return up(
        "topside",
        replace(choices, name=name),
        listen=None,
        connect=None,
        router=router,
        gateway=False,
        grouped=grouped,
        keys=keys,
        insecure=insecure,
    )
