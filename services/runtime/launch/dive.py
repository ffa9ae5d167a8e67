"""What is settled of a dive before anything of it is started on this machine."""

import msgspec

from messages.topic import Side
from services.runtime.bus.key_files import Credentials
from services.runtime.config.stack import Stack
from services.runtime.hosts.registry import Registry
from services.runtime.launch.supervisor import NAME


class Dive(msgspec.Struct, frozen=True):
    """The part of a dive that is on this machine, checked. As JSON it needs `enc_hook=str` and
    `dec_hook=path` for the path of the stack file."""

    stack: Stack  # what every service of the dive is told
    services: Registry  # of this machine
    side: Side | None = None  # of this machine; None: both sides are on it
    elsewhere: tuple[str, ...] = ()  # services of the other machine
    # Endpoints at which the other side reaches this hub; without another side, other programs.
    listen: tuple[str, ...] = ()
    connect: tuple[str, ...] = ()  # … or at which this hub reaches the other side's
    gateway: str | None = None  # endpoint of the drone's hub, for a tether process between them
    credentials: Credentials | None = None  # for endpoints of and for other machines
    begin_with: dict[str, bytes] = {}  # files that the folder of the checkpoints begins with

    @property
    def supervisor(self) -> str:
        """Its name on the bus. Two machines have two, and each receives the other's health."""
        return NAME if self.side is None else f"{NAME}_{self.side}"
