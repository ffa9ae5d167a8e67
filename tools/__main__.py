"""The `lindy` command. Each verb imports what it needs only when it is called, so that `--help`
and a mistyped command answer at once."""

import sys
import traceback
from collections.abc import Callable, Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Annotated

from cyclopts import App, CycloptsError, Parameter

from services.runtime.config.errors import LindyError
from tools.choices import Choices, named
from tools.gains import gains
from tools.keys.command import keys
from tools.link import link
from tools.profile import profile
from tools.ramp import ramp
from tools.sweep.command import sweep

ERROR = 1  # exit status
DEBUG = "--debug"
PAPERS = "tools.research"  # not in an installed package
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


app = App(
    name="lindy",
    help="Pilot an underwater drone: the pilot leads, the drone follows, without a jerk.",
    help_epilogue="With --debug before or after any verb, an error shows where it came from.",
    help_format="plaintext",
    version=lambda: version("lindy"),
)


@app.command
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
        grouped=grouped,
        keys=keys,
        insecure=insecure,
    )


@app.command
def up(
    side: str,
    *,
    listen: Annotated[
        str, Parameter(help="drone: endpoint for the topside, e.g. tls/192.168.2.2:7447")
    ] = "tcp/127.0.0.1:7447",
    connect: Annotated[
        str, Parameter(help="topside: endpoint of the drone, e.g. tls/192.168.2.2:7447")
    ] = "tcp/127.0.0.1:7447",
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
    both connect on this machine. Between machines both need keys: see `lindy keys`.

    Example: lindy up drone --listen tls/192.168.2.2:7447
             lindy up topside --connect tls/192.168.2.2:7447
    """
    from tools.up import up

    return up(
        side,
        choices or Choices(),
        listen=listen,
        connect=connect,
        gateway=gateway,
        grouped=grouped,
        resume=resume,
        keys=keys,
        insecure=insecure,
    )


@app.command
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
) -> int:
    """The same dive on virtual time, as fast as the computer can, with the same files.

    Example: lindy simulate --seed 7 --set control.depth.kp=3 --out dives/simulated
             lindy simulate --no-files --link severe
    """
    from tools.simulate import simulate

    return simulate(choices or Choices(), files=files)


@app.command
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
    choices: Choices | None = None,
) -> int:
    """Run one service in the foreground, on hubs that are already running.

    Example: lindy run control --connect drone=tcp/127.0.0.1:7448
    """
    from tools.run import run

    return run(service, connect, choices or Choices(), keys)


@app.command
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


@app.command
def picture(
    recording: Path,
    *,
    out: Annotated[Path, Parameter(converter=named, help="the PNG to write, a new file")] = Path(
        "dive.png"
    ),
    at: Annotated[
        float | None, Parameter(help="seconds since the dive began; default: its end")
    ] = None,
    page: Annotated[str, Parameter(help="dive, motion, control, sensors, link or health")] = "dive",
) -> int:
    """Write a picture of a recorded dive as the viewer shows it, without a display.

    RECORDING is a dive's folder, or the dive.rrd in it. It needs Vulkan, in software at least; on
    Debian: apt install mesa-vulkan-drivers libvulkan1

    Example: lindy picture dives/latest --at 40 --page link --out link.png
    """
    from tools.picture import picture

    picture(recording, out, at, page)
    return 0


@app.command
def path(
    file: str,
    *,
    dt: Annotated[float | None, Parameter(help="[s] between samples, for the reference")] = None,
) -> int:
    """Print a path (JSON), or with --dt the whole reference along it (CSV).

    FILE is a TOML file or a name in deploy/paths. Keys: waypoints, min_radius, kind, smooth_yaw;
    cruise, speeds; model, acceleration, jerk, accel_time, decel_time, epsilon, theta_a, theta_d,
    theta_0, xi.

    Example: lindy path deploy/paths/fernandes.toml --dt 0.15
    """
    from tools.path import path

    return path(file, dt=dt)


@app.command
def ask(
    kind: str,
    hold: Annotated[
        str | None,
        Parameter(help="mode: manual, depth_hold, heading_hold, stabilised or station_keeping"),
    ] = None,
    *,
    depth: Annotated[float | None, Parameter(help="goto: [m] positive down")] = None,
    heading: Annotated[
        float | None, Parameter(help="goto: [deg] clockwise from north, shortest way")
    ] = None,
    north: Annotated[
        float | None, Parameter(help="goto: [m], with --east; needs a drone that measures position")
    ] = None,
    east: Annotated[float | None, Parameter(help="goto: [m]")] = None,
    path: Annotated[
        str | None, Parameter(help="follow: a name in deploy/paths, or a TOML file")
    ] = None,
    value: Annotated[float | None, Parameter(help="light: brightness 0 … 1")] = None,
    force: Annotated[
        bool,
        Parameter(negative=(), show_default=False, help="take: from whoever has control"),
    ] = False,
    to: Annotated[
        str | None, Parameter(help="offer: to the pilot of this name only; default: to any")
    ] = None,
    dive: Annotated[
        Path | None, Parameter(help="folder of a dive that is going on; default: the newest")
    ] = None,
    json: Annotated[
        bool, Parameter(negative=(), show_default=False, help="answer as JSON")
    ] = False,
) -> int:
    """Send a request to a running dive, and print the drone's answer.

    KIND is arm, disarm, stop, light, goto, follow or mode; take, offer or release control. It is
    asked in the name of the pilot of that dive.

    Example: lindy ask goto --depth 3 --heading 90
    """
    from tools.ask import ask

    return ask(
        kind,
        hold,
        depth=depth,
        heading=heading,
        north=north,
        east=east,
        path=path,
        value=value,
        force=force,
        to=to,
        dive=dive,
        as_json=json,
    )


@app.command
def fault(
    part: str,
    kind: str,
    *,
    value: Annotated[
        float | None,
        Parameter(help="weak: share of the thrust; noisy: times; biased: sensor's unit"),
    ] = None,
    dive: Annotated[
        Path | None, Parameter(help="folder of a dive that is going on; default: the newest")
    ] = None,
) -> int:
    """Make a part of the simulated vehicle fail during a dive, or repair it.

    PART is a thruster's name, a sensor's key such as sensor/pressure, or all. KIND is none (to
    repair); dead, reversed, weak or stuck (a thruster); silent, frozen, noisy, biased or broken (a
    sensor).

    Example: lindy fault port dead
    """
    from tools.fault import fault

    return fault(part, kind, value, dive)


log = App(name="log", help="Analyse recordings.")
app.command(log)


@log.command
def noise(
    recording: Path,
    *,
    json: Annotated[
        bool, Parameter(negative=(), show_default=False, help="no lines, JSON")
    ] = False,
) -> int:
    """Noise, rate and drift of the sensors, from a recording of a drone that lies still.

    RECORDING is a dive's folder or its MCAP file. Prints the lines to paste into the vehicle file.
    It uses the longest time in which the drone was neither armed nor moved, at least 20 s. To make
    a recording, start the drone's side alone, so that nobody arms it, and press Ctrl-C after a
    minute or longer.

    Example: lindy up drone --out dives/on_the_bench
             lindy log noise dives/on_the_bench
    """
    from tools.noise import noise

    return noise(recording, json=json)


@app.command
def bench(
    *,
    only: Annotated[
        tuple[str, ...], Parameter(negative=(), show_default=False, help="a section; repeatable")
    ] = (),
    json: Annotated[
        bool, Parameter(negative=(), show_default=False, help="no table, JSON")
    ] = False,
) -> int:
    """Compare Lindy's speed with other implementations, as ratios with their goals.

    Example: lindy bench --only reference --json
    """
    from tools.research.bench import bench

    return bench(only=only, json=json)


@app.command
def figures(
    *,
    out: Annotated[Path, Parameter(converter=named)],
    only: Annotated[
        tuple[str, ...], Parameter(negative=(), consume_multiple=True, show_default=False)
    ] = (),
) -> int:
    """Draw the two papers' figures on references and control, and check their numbers.

    Example: lindy figures --out figures --only andren-4.2 fernandes-10

    Writes ID.png and ID.svg for each figure, and claims.json: each claim with the paper's value,
    ours, and a verdict. The same files, byte for byte, on every run.

    Args:
        out: folder, made if it is not there; where it holds such files already, a new one beside
            it.
        only: ids of figures to draw, instead of all; claims.json is written in any case, with
            claims about flights (fernandes-6 to 8, 14 to 17) only where one of these is drawn.
    """
    from tools.research.papers.command import figures

    return figures(out=out, only=only)


app.command(profile)
app.command(ramp)
app.command(gains)
app.command(link)
app.command(sweep)
app.command(keys)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a verb. Returns the exit status: 0 clean, 1 error, 3 done but data or a service was
    lost."""
    words = [*(sys.argv[1:] if arguments is None else arguments)]
    if DEBUG not in words:
        return _run(words)
    return _run([word for word in words if word != DEBUG], explain=traceback.print_exc)


def _run(words: Sequence[str], explain: Callable[[], None] = lambda: None) -> int:
    """`explain` is called for every error but a mistyped command line."""
    try:
        status = app(words, exit_on_error=False, print_error=False, result_action="return_value")
    except CycloptsError as error:
        return complain(str(error))
    except LindyError as error:
        explain()
        return complain(str(error))
    except KeyboardInterrupt:
        return complain("interrupted")
    except OSError as error:
        explain()
        return complain(f"{error.filename or 'operating system'}: {error.strerror or error}")
    except Exception as error:
        explain()
        if (absent := _papers_tools(error, words)) is not None:
            return complain(absent)
        where = traceback.extract_tb(error.__traceback__)[-1]
        name = f"{Path(where.filename).name}:{where.lineno}"
        what = f"{type(error).__name__}: {error}"
        return complain(f"an error in Lindy itself ({DEBUG} shows more), at {name}: {what}")
    return status or 0


def _papers_tools(error: Exception, words: Sequence[str]) -> str | None:
    """What to say where the error is that an installed package has no tools/research."""
    if not isinstance(error, ModuleNotFoundError) or error.name != PAPERS:
        return None
    return (
        f"what `lindy {words[0]}` needs here belongs to the papers' tools, which are in the source "
        f"tree, not in the installed package; run it there: uv run lindy {words[0]}"
    )


def complain(sentence: str) -> int:
    print(f"lindy: {' '.join(sentence.split())}", file=sys.stderr, flush=True)
    return ERROR


if __name__ == "__main__":
    sys.exit(main())
