"""The `lindy` command: which verbs there are, and what it says where one fails.

A verb is a function in a module of its own: its parameters are the options, its docstring is the
help. It returns the exit status, and raises LindyError for a mistake of the user. Only the module
of the verb that is called is imported, so that help answers at once.
"""

import os
import signal
import sys
from collections.abc import Generator, Sequence
from contextlib import contextmanager
from errno import ENOSPC
from importlib.util import find_spec
from io import TextIOWrapper
from typing import TYPE_CHECKING, Any, NamedTuple

from messages.version import VERSION
from services.runtime.config.errors import EndedByUserError, LindyError
from services.runtime.os import system
from tools.exit_status import ERROR, INTERRUPTED, UNREAD

if TYPE_CHECKING:
    from cyclopts import App

LONGEST = 2000  # letters of a complaint: it repeats what was given, which may have any length
DEBUG = "--debug"
HELP = ("--help", "-h")
RESEARCH = "lindy_research"  # a package of its own, which is not on every computer
GONE = {
    "fleet": "`lindy drones --watch` lists the drones again and again",
    "keys renew": "`lindy keys add ROLE NAME --again`",
    "link down": "`lindy link set down`",
    "link profile": "`lindy link set PROFILE`",
    "link trace": "`lindy log export RECORDING --as trace`",
    "link up": "`lindy link set up`",
    "log csv": "`lindy log export RECORDING --as csv`",
    "log jerk": "`smoothness` in report.json",
    "log noise": "`lindy calibrate noise`",
    "log parquet": "`lindy log export RECORDING --as parquet`",
    "log rosbag": "`lindy log export RECORDING --as rosbag`",
    "log scene": "open several .rrd files in one rerun",
    "log sticks": "`lindy log export RECORDING --as sticks`",
    "picture": "`lindy log export RECORDING --as rrd`, then `rerun` shows it",
    "record": "each drone records on board; fetch its files after the dive",
    "router-config": "change deploy/router.json5, whose comments say what",
    "topic bw": "`lindy topic hz`, which shows this, too",
    "topic delay": "`lindy topic hz`, which shows this, too",
    "tour": "the steps of a first dive are in docs/flying.md",
}  # verb of an earlier version → what to use instead
GONE_OPTIONS = {
    "ask --path": "`lindy ask follow PATH`",
    "ask --to": "`lindy ask offer NAME`",
    "ask --value": "`lindy ask light 0.5`",
    "bench --json": "`make bench` keeps every figure in performance.json",
    "dive --trust": "a line says that a stack file runs code of others",
    "fly --link": "the link is emulated by `lindy up topside --gateway` only",
    "fly --name": "the name of the drone is said once, `lindy fly NAME`",
    "fly --seconds": "end it with Ctrl-C",
    "fly --seed": "a topside draws nothing",
    "fly --trust": "a line says that a stack file runs code of others",
    "gains --force": "--effort",
    "gains --rate": "--error-rate",
    "identify --net-buoyancy": "weighed, over the one found, it is the scale of the thrust",
    "keys new --drone": "`lindy keys new DRONE PILOT`",
    "keys new --pilot": "`lindy keys new DRONE PILOT`",
    "keys list --json": "its table",
    "link show --profile": "`lindy link show PROFILE`",
    "link show --rate": "--hz",
    "log compare --out": "--json has every difference",
    "log compare --tolerance": "--json has every difference with its size",
    "log cut --dive": "--number",
    "log film --overlay": "the film's subtitles say the same",
    "pad --profile": "`lindy pad PROFILE`",
    "pad --seconds": "end it with Ctrl-C",
    "pad --write": "copy deploy/pads/default.toml, and change it by what `lindy pad` shows",
    "profile --accel-time": "`lindy profile LENGTH CRUISE ACCEL_TIME DECEL_TIME`",
    "profile --cruise": "`lindy profile LENGTH CRUISE ACCEL_TIME DECEL_TIME`",
    "profile --decel-time": "`lindy profile LENGTH CRUISE ACCEL_TIME DECEL_TIME`",
    "profile --length": "`lindy profile LENGTH CRUISE ACCEL_TIME DECEL_TIME`",
    "ramp --to": "`lindy ramp --plan VELOCITY`",
    "replay --connect": "--listen",
    "replay --loop": "begin it again",
    "review --quick": "a review flies nothing again; `lindy simulate` does",
    "ros2 --vehicle": "it has the vehicle file of the dive",
    "simulate --name": "--set vehicle.name=NAME",
    "run --seconds": "end it with Ctrl-C",
    "sweep --fast": "every dive is flown exactly, on all cores",
    "sweep --record": "`lindy simulate` flies the dive of a row again, with its files",
    "topic echo --side": "what never leaves the drone is heard there, all else topside",
    "topic hz --side": "what never leaves the drone is heard there, all else topside",
    "top --order": "the dearest service is the first line",
    "up --trust": "a line says that a stack file runs code of others",
}  # verb and option of an earlier version → what to use instead
ABOUT = "Pilot an underwater drone: the pilot leads, the drone follows, without a jerk."
EPILOGUE = f"With {DEBUG} before or after any verb, an error shows where it came from."


class Verb(NamedTuple):
    """A verb of `lindy`, or of `lindy log`."""

    place: str  # MODULE:FUNCTION within this package, or of the package lindy-research
    help: str  # one line; a test compares it with the docstring


GROUPS: dict[str, dict[str, Verb]] = {
    "Fly": {
        "dive": Verb("start:dive", "Fly a dive on this machine: every service, record and report."),
        "simulate": Verb("simulate:simulate", "Fly a dive on virtual time, as fast as possible."),
        "up": Verb("up:up", "Start one SIDE of a dive, topside or drone, on this machine."),
        "fly": Verb("up:fly", "Start the topside for one of several drones."),
        "ask": Verb("ask:ask", "Send a request to a running dive, and print the answer."),
        "ros2": Verb("ros2:ros2", "Show a running dive in ROS 2, and have it flown from there."),
        "pad": Verb("pad.command:pad", "Show what a pad sends, and what a profile makes of it."),
    },
    "Drones and links": {
        "drones": Verb("fleet.drones:drones", "List the drones that can be reached."),
        "keys": Verb(
            "keys.command:keys",
            "Make and revoke the keys by which drone and pilot know each other.",
        ),
        "top": Verb("topic.command:top", "Show what each service costs, and how late it is."),
        "topic": Verb(
            "topic.command:topic", "List the streams of a dive; show, time and weigh them."
        ),
        "link": Verb("link:link", "Show the model of the tether, or change a running link."),
    },
    "Recordings": {
        "review": Verb(
            "review.command:review", "Review a dive of any vehicle: one page with plots."
        ),
        "import": Verb(
            "importing.command:import_log", "Make a recording of a log that another program wrote."
        ),
        "log": Verb("", "Look into recordings: check, cut, mend, convert, compare."),
        "replay": Verb("replay.command:replay", "Play a dive again, or compare today's code."),
    },
    "Vehicle": {
        "doctor": Verb(
            "doctor.command:doctor", "Check a vehicle file, its ArduSub board and its instruments."
        ),
        "check-driver": Verb(
            "driver.command:check_driver",
            "Check that a driver keeps what every vehicle side promises.",
        ),
        "calibrate": Verb("calibrate.command:calibrate", "Find the errors of a vehicle's sensors."),
        "identify": Verb(
            "identify.command:identify", "Find inertia, drag, buoyancy and lag in a dive."
        ),
        "gains": Verb("gains:gains", "Find control gains for an axis of a vehicle (LQ)."),
        "fault": Verb("fault:fault", "Make a part of the simulated vehicle fail, or repair it."),
    },
    "Study": {
        "sweep": Verb("sweep.sweep:sweep", "Simulate many dives on all cores, into one table."),
        "path": Verb("path:path", "Print a path (JSON), or the reference along it (CSV)."),
        "profile": Verb("path:profile", "Print one motion of the reference model."),
        "ramp": Verb("ramp:ramp", "Turn a stick log into a smooth reference (CSV)."),
        "figures": Verb(
            f"{RESEARCH}.papers.command:figures",
            "Draw the figures of two papers, and check their numbers.",
        ),
        "bench": Verb(f"{RESEARCH}.bench:bench", "Compare speed with other implementations."),
    },
    "This program": {
        "completion": Verb(
            "completion:completion", "Print the completion of verbs and options for a shell."
        ),
    },
    "Single processes": {
        "run": Verb("run:run", "Run one service in the foreground, on running hubs."),
        "hub": Verb("run:hub", "Run a side's hub in the foreground."),
    },
}
VERBS = {name: verb for group in GROUPS.values() for name, verb in group.items()}
LOG: dict[str, Verb] = {
    "info": Verb("log.info:info", "Print what a recording is of, and what is in it."),
    "check": Verb(
        "log.check:check",
        "Check that everything that was sent is in it; print what was lost where.",
    ),
    "cut": Verb("log.cut:cut", "Cut a part out, as a recording of its own."),
    "recover": Verb("log.cut:recover", "Save what can be read of a damaged recording."),
    "export": Verb(
        "log.export:export",
        "Write tables, a bag of ROS 2, a stick log, a link's trace, or rerun's file.",
    ),
    "compare": Verb(
        "log.compare:compare", "Print what differs between two recordings, and when first."
    ),
    "film": Verb("log.film:film", "Write the pictures as a film with subtitles (MP4)."),
    "snapshots": Verb("log.snapshots:snapshots", "Write the pictures that the pilot took (JPEG)."),
}


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a verb. Returns its exit status."""
    words = [*(sys.argv[1:] if arguments is None else arguments)]
    debug = DEBUG in words
    _printable()
    try:
        status = _run([word for word in words if word != DEBUG])
        sys.stdout.flush()  # here, where it may fail
    except KeyboardInterrupt:
        complain("interrupted")
        return INTERRUPTED
    except SystemExit as ended:  # rich ends the program where nobody reads
        if isinstance(ended.__context__, BrokenPipeError):
            return UNREAD
        raise
    except Exception as error:
        if isinstance(error, BrokenPipeError) and _nobody_reads():
            return UNREAD
        complain(_sentence(error, debug=debug))
        return INTERRUPTED if isinstance(error, EndedByUserError) else ERROR
    return status or 0


def _printable() -> None:
    """What a terminal has no letter for is printed as ?, and what is printed where stdout or stderr
    are closed goes nowhere: neither is a reason to end a dive."""
    for name in ("stdout", "stderr"):
        if getattr(sys, name) is None:
            # It stays open for as long as the program runs.
            setattr(sys, name, open(os.devnull, "w", encoding="utf-8"))  # noqa: PTH123, SIM115
        elif isinstance(stream := getattr(sys, name), TextIOWrapper):
            stream.reconfigure(errors="replace")


def _run(words: Sequence[str]) -> int | None:
    """Raises LindyError, CycloptsError: a mistake of the user."""
    with _interrupted_at_once():
        verb = _verb_of(words)
        program = command_line(listed=not verb, helps=not {*HELP}.isdisjoint(words))
        command = program
        for name in verb:
            command = command[name]  # loads its module
    return program(words)


def _verb_of(words: Sequence[str]) -> Sequence[str]:
    """The verb in a command line; none where only help is asked for. A mistyped one is said without
    importing all of them, which takes two seconds.

    Raises:
        LindyError: there is no such verb, or it is not installed.
    """
    two = " ".join(words[:2])
    if two in GONE:
        raise LindyError(f"`lindy {two}` is gone: {GONE[two]}")
    of_log = words[:1] == ["log"]
    verbs, name = LOG if of_log else VERBS, next(iter(words[of_log:]), "--help")
    if name in (*HELP, "--version"):
        return ()
    if name not in verbs:
        from services.runtime.config.settings import nearest

        if not of_log and name in GONE:
            raise LindyError(f"`lindy {name}` is gone: {GONE[name]}")
        raise LindyError(f"unknown command {name!r}{nearest(name, [*verbs])}")
    if verbs[name].place.startswith(RESEARCH) and find_spec(RESEARCH) is None:
        raise LindyError(
            f"`lindy {name}` is in the package lindy-research, which is not installed; "
            f"in the folder of Lindy's source, `uv run lindy {name}` installs and runs it"
        )
    return ("log", name) if of_log else (name,)


def command_line(*, listed: bool = False, helps: bool = False) -> "App":
    """All verbs, each loaded when it is called.

    Args:
        listed: each with its one line in place of its own help, so that none is loaded to list it.
        helps: a help will be shown; what lays it out takes a twentieth of a second to load.
    """
    from cyclopts import App, Group, Parameter

    formatter = None
    if helps:
        from tools.flowing_help import FlowingHelp

        formatter = FlowingHelp()
    program = App(
        name="lindy",
        help=ABOUT,
        help_epilogue=EPILOGUE,
        help_format="plaintext",
        help_formatter=formatter,
        version=VERSION,
        exit_on_error=False,
        print_error=False,
        result_action="return_value",
        suppress_keyboard_interrupt=False,  # it would be silent
        default_parameter=Parameter(negative=(), show_default=_shown),
    )
    log = App(name="log", help=VERBS["log"].help)
    groups = [(program, Group.create_ordered(name), GROUPS[name]) for name in GROUPS]
    for app, group, verbs in (*groups, (log, None, LOG)):
        for place_in_list, (name, verb) in enumerate(verbs.items()):
            if name == "log":
                log.group, log.sort_key = group, place_in_list
                app.command(log)
                continue
            place = verb.place if verb.place.startswith(RESEARCH) else f"{__package__}.{verb.place}"
            line = {"help": verb.help} if listed else {}
            app.command(place, name=name, group=group, sort_key=place_in_list, **line)
    return program


def _shown(default: object) -> str | None:
    """A default in the help, unless it only says that there is nothing."""
    words = str(default)
    return None if words in ("", "None", "True", "False", "inf") or words[0] == "(" else words


@contextmanager
def _interrupted_at_once() -> Generator[None]:
    """Ctrl-C meanwhile is one sentence. Nothing has begun that must be ended, and an exception
    would be raised in the middle of any module that is being loaded."""
    waiting = signal.getsignal(signal.SIGINT) is signal.default_int_handler  # else it is ignored
    if waiting:
        signal.signal(signal.SIGINT, _leave)
    try:
        yield
    finally:
        if waiting:
            signal.signal(signal.SIGINT, signal.default_int_handler)


def _leave(*_: object) -> None:
    os.write(2, b"lindy: interrupted\n")
    os._exit(INTERRUPTED)


def _sentence(error: Exception, *, debug: bool) -> str:
    """What to say of an error. With `debug`, all but a mistyped command line are printed, too."""
    import traceback

    if isinstance(error, ImportError) and isinstance(error.__cause__, ImportError):
        error = error.__cause__  # cyclopts says only of which verb it was
    if type(error).__module__ == "cyclopts.exceptions":
        return _mistyped(error)
    if debug:
        traceback.print_exception(error)
    if isinstance(error, LindyError):
        return str(error)
    if isinstance(error, OSError):
        if error.filename is None and error.errno == ENOSPC:
            return "the disk is full: there is no room for what it prints or writes"
        return f"{error.filename or 'operating system'}: {error.strerror or error}"
    if isinstance(error, ImportError) and not isinstance(error, ModuleNotFoundError):
        return f"a library cannot be loaded: {error}; it is damaged, or there is too little memory"
    if isinstance(error, MemoryError):
        return "there is not enough memory for this"
    where = traceback.extract_tb(error.__traceback__)[-1]
    name = where.filename.rpartition("/")[2]
    what = f"{type(error).__name__}: {error}"
    return f"an error in Lindy itself ({DEBUG} shows more), at {name}:{where.lineno}: {what}"


def _mistyped(error: Any) -> str:
    """A command line that cyclopts refuses. What is missing, too much or no number it says in words
    for programmers."""
    from cyclopts import (
        CoercionError,
        MissingArgumentError,
        UnknownOptionError,
        UnusedCliTokensError,
    )

    verb, said = " ".join(("lindy", *(error.command_chain or ()))), f"{error}"
    if isinstance(error, MissingArgumentError) and error.argument is not None:
        needs = error.argument.name
        said = f"{error.keyword} needs a value." if error.keyword else f"`{verb}` needs {needs}."
    elif isinstance(error, UnknownOptionError):
        option = (error.token.keyword or error.token.value).partition("=")[0]
        place = option.lstrip("-").replace("-", "_").upper()
        if instead := GONE_OPTIONS.get(f"{verb.removeprefix('lindy ')} {option}"):
            return f"{option} of `{verb}` is gone: {instead}"
        if any(place in argument.names for argument in error.argument_collection):
            said = f"`{verb}` takes {place} without {option}."
    elif isinstance(error, UnusedCliTokensError):
        said = f"`{verb}` takes no {' '.join(error.unused_tokens or ())}."
    elif isinstance(error, CoercionError) and error.target_type is float and error.token:
        said = f"{error.token.keyword} is {error.token.value!r}, expected a number."
    elif isinstance(error, CoercionError) and error.msg and error.token:
        said = f"{error.token.keyword}: {error.msg}."
    return f"{said} `{verb} --help` says more"


def _nobody_reads() -> bool:
    """Has whoever read the output ended, as `head` does? Then nothing more is written to it, not
    even by Python as it ends."""
    if not system.is_unread(sys.stdout.fileno()):
        return False
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    return True


def complain(sentence: str) -> int:
    from messages.text import harmless

    words = " ".join(sentence.split())
    if len(words) > LONGEST:
        words = f"{words[: LONGEST // 2]} […] {words[-LONGEST // 2 :]}"
    print(f"lindy: {harmless(words)}", file=sys.stderr, flush=True)
    return ERROR


if __name__ == "__main__":
    sys.exit(main())
