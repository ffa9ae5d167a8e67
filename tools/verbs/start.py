"""Verbs that start something: a dive, one side of it, one service, a hub."""

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from tools.choices import Choices, named

KeysFolder = Annotated[
    Path | None,
    Parameter(converter=named, help="folder of the keys; default: ~/.config/lindy/keys"),
]
Insecure = Annotated[
    bool,
    Parameter(negative=(), show_default=False, help="no keys: whoever reaches the port may fly"),
]
Grouped = Annotated[
    bool,
    Parameter(
        negative=(),
        show_default=False,
        help="few processes instead of one per service, for a small computer: services that have "
        "none of their own in the stack file share one per side",
    ),
]


def dive(
    *,
    choices: Choices | None = None,
    headless: Annotated[
        bool,
        Parameter(
            negative=(), show_default=False, help="no live viewer, even where there is a display"
        ),
    ] = False,
    listen: Annotated[
        str | None,
        Parameter(help="endpoint for other programs on the topside, e.g. tcp/127.0.0.1:7447"),
    ] = None,
    cockpit: Annotated[
        bool,
        Parameter(
            negative=(),
            show_default=False,
            help="fly in a browser: prints the page's address, and opens it where there is a "
            "display; with --pilot it is beside that pilot",
        ),
    ] = False,
    grouped: Grouped = False,
    keys: KeysFolder = None,
    insecure: Insecure = False,
) -> int:
    """Start every service on this machine, pilot the drone, record the dive and report on it.

    Example: lindy dive --pilot script:first_dive --link remote --out dives/first
             lindy dive --stack real --set driver.port=/dev/ttyACM0
    """
    from tools.dive import dive

    return dive(
        choices or Choices(),
        headless=headless,
        listen=listen,
        cockpit=cockpit,
        grouped=grouped,
        keys=keys,
        insecure=insecure,
    )


def up(
    side: str,
    *,
    listen: Annotated[
        str | None,
        Parameter(
            help="drone: endpoint for the topside, e.g. tls/192.168.2.2:7447; default "
            "tcp/127.0.0.1:7447"
        ),
    ] = None,
    connect: Annotated[
        str | None,
        Parameter(
            help="topside: endpoint of the drone, e.g. tls/192.168.2.2:7447; default "
            "tcp/127.0.0.1:7447"
        ),
    ] = None,
    router: Annotated[
        str | None,
        Parameter(
            help="either side: endpoint of a Zenoh router where both meet; see docs/fleet.md"
        ),
    ] = None,
    gateway: Annotated[
        bool,
        Parameter(
            negative=(),
            show_default=False,
            help="topside: add the emulated link (--link) to the real one",
        ),
    ] = False,
    resume: Annotated[
        Path | None,
        Parameter(
            help="drone: folder of the dive that a power cut ended; goes on with its calibration"
        ),
    ] = None,
    grouped: Grouped = False,
    keys: KeysFolder = None,
    insecure: Insecure = False,
    choices: Choices | None = None,
) -> int:
    """Start one SIDE of a dive, topside or drone, on this machine; the other side runs on another.

    Start the drone first. Each side has its own clock; the clock offset is measured. By default
    both connect on this machine. Between machines both need keys: see `lindy keys`. A topside
    without --name takes the one drone that can be reached.

    Example: lindy up drone --listen tls/192.168.2.2:7447
             lindy up topside --connect tls/192.168.2.2:7447
    """
    from tools.up import up

    return up(
        side,
        choices or Choices(),
        listen=listen,
        connect=connect,
        router=router,
        gateway=gateway,
        grouped=grouped,
        resume=resume,
        keys=keys,
        insecure=insecure,
    )


def simulate(
    *,
    choices: Choices | None = None,
    files: Annotated[
        bool,
        Parameter(
            name="--files",
            negative="--no-files",
            show_default=False,
            help="--no-files: no recording, no viewer, no folder; the report only, sooner",
        ),
    ] = True,
    from_: Annotated[
        Path | None,
        Parameter(
            name="--from",
            converter=named,
            help="folder or MCAP file of a recorded dive: fly it again, from nothing else, and "
            "fail (exit status 1) where what is recorded is not the same, bit for bit",
        ),
    ] = None,
) -> int:
    """The same dive on virtual time, as fast as the computer can, with the same files.

    Example: lindy simulate --seed 7 --set control.depth.kp=3 --out dives/simulated
             lindy simulate --no-files --link severe
             lindy simulate --from dives/latest
    """
    if from_ is not None:
        from tools.fly_again import fly_again

        return fly_again(from_, choices or Choices(), files=files)
    from tools.simulate import simulate

    return simulate(choices or Choices(), files=files)


def run(
    service: str,
    *,
    connect: Annotated[
        tuple[str, ...],
        Parameter(
            negative=(),
            show_default=False,
            help="SIDE=ENDPOINT of a hub, once for each side of the service",
        ),
    ] = (),
    keys: Annotated[
        Path | None,
        Parameter(
            converter=named,
            help="for a hub at tls/…: folder of the keys; default: ~/.config/lindy/keys",
        ),
    ] = None,
    replay: Annotated[
        bool,
        Parameter(
            negative=(),
            show_default=False,
            help="visualizer: show what `lindy replay --listen` plays, and no vehicle",
        ),
    ] = False,
    choices: Choices | None = None,
) -> int:
    """Run one service in the foreground, on hubs that are already running.

    Example: lindy run control --connect drone=tcp/127.0.0.1:7448
    """
    from tools.run import run

    return run(service, connect, choices or Choices(), keys, replay=replay)


def hub(
    endpoint: str,
    *,
    insecure: Annotated[
        bool,
        Parameter(negative=(), show_default=False, help="let in whoever reaches the endpoint"),
    ] = False,
) -> int:
    """Run a side's hub in the foreground.

    Example: lindy hub tcp/127.0.0.1:7448
    """
    from tools.run import hub

    return hub(endpoint, insecure=insecure)
