"""The `lindy` command: which verbs there are, and what it says where one fails.

A verb is a function in a module of its own: its parameters are the options, its docstring is the
help. It returns the exit status, and raises LindyError for a mistake of the user. Only the module
of the verb that is called is imported, so that help and a mistyped verb answer at once.
"""

import os
import signal
import sys
from collections.abc import Collection, Mapping, Sequence
from io import TextIOWrapper
from typing import Any, NamedTuple

from messages.version import VERSION
from services.runtime.config.errors import EndedByUserError, LindyError
from services.runtime.os import system

ERROR, INTERRUPTED = 1, 130  # exit statuses
UNREAD = 141  # exit status: nobody reads the output any more; that of a program that SIGPIPE ends
LONGEST = 2000  # letters of a complaint: it repeats what was given, which may have any length
DEBUG = "--debug"
HELP = ("--help", "-h")
NUMBERS = {float: "a number, such as 1.5", int: "a whole number"}  # as options are said to be
ABOUT = "Pilot an underwater drone: the pilot leads, the drone follows, without a jerk."
EPILOGUE = f"With {DEBUG} before or after any verb, an error shows where it came from."


class Verb(NamedTuple):
    """A verb of `lindy`, or of `lindy log`."""

    place: str  # MODULE:FUNCTION within this package; empty: of another, as an entry point
    help: str  # one line; a test compares it with the docstring


GROUPS: dict[str, dict[str, Verb]] = {
    "Fly": {
        "dive": Verb("dive:dive", "Fly a dive on this machine: every service, record and report."),
        "simulate": Verb("simulate:simulate", "Fly a dive on virtual time, as fast as possible."),
        "up": Verb("up:up", "Start one SIDE of a dive, topside or drone, on this machine."),
        "fly": Verb("fleet.fly:fly", "Start the topside for one of several drones."),
        "ask": Verb("ask:ask", "Send a request to a running dive, and print the answer."),
        "ros2": Verb("ros2:ros2", "Show a running dive in ROS 2, and have it flown from there."),
        "pad": Verb("pad.command:pad", "Show what a pad sends, and write a profile for it."),
    },
    "Drones and links": {
        "drones": Verb("fleet.drones:drones", "List the drones that can be reached."),
        "keys": Verb("keys.command:keys", "Keys by which drone and pilot recognise each other."),
        "top": Verb("topic.top:top", "Show what each service costs, and how late it is."),
        "topic": Verb(
            "topic.command:topic", "List the streams of a dive; show, time and weigh them."
        ),
        "link": Verb("link:link", "The tether: its model offline, a running link, a recorded one."),
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
        "picture": Verb("picture:picture", "Draw a recorded dive as the viewer shows it."),
    },
    "Vehicle": {
        "doctor": Verb(
            "doctor.command:doctor", "Check a vehicle file, its ArduSub board and its instruments."
        ),
        "calibrate": Verb("calibrate.command:calibrate", "Find the errors of a vehicle's sensors."),
        "identify": Verb(
            "identify.command:identify", "Find inertia, drag, buoyancy and lag in a dive."
        ),
        "gains": Verb("gains:gains", "Find control gains for an axis of a vehicle (LQ)."),
        "fault": Verb("fault:fault", "Make a part of the simulated vehicle fail, or repair it."),
    },
    "Study": {
        "sweep": Verb("sweep.command:sweep", "Simulate many dives on all cores, into one table."),
        "path": Verb("path:path", "Print a path (JSON), or the reference along it (CSV)."),
        "profile": Verb("profile:profile", "Print one motion of the reference model."),
        "ramp": Verb("ramp:ramp", "Turn a stick log into a smooth reference (CSV)."),
        "figures": Verb("", "Draw the two papers' figures."),
        "bench": Verb("", "Compare speed with other implementations."),
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
    "info": Verb("log.info:info", "What a recording is of, and what is in it."),
    "check": Verb("log.check:check", "Is everything in it that was sent, and what was lost where?"),
    "cut": Verb("log.cut:cut", "Cut a part out, as a recording of its own."),
    "recover": Verb("log.recover:recover", "Save what can be read of a damaged recording."),
    "csv": Verb("log.csv_table:csv", "Write every topic as a table: one CSV file each."),
    "parquet": Verb(
        "log.parquet_table:parquet", "Write every topic as a table: one Parquet file each."
    ),
    "rosbag": Verb(
        "log.rosbag:rosbag", "As a bag of ROS 2 (rosbag2, MCAP), with standard messages."
    ),
    "compare": Verb("log.compare:compare", "What differs between two recordings, when first."),
    "sticks": Verb("log.sticks:sticks", "The pilot's sticks, as a stick log to fly again."),
    "film": Verb("log.film:film", "The pictures as a film with subtitles (MP4)."),
    "snapshots": Verb("log.snapshots:snapshots", "The pictures that the pilot took (JPEG)."),
}


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a verb. Returns the exit status: 0 clean, 1 error, 3 done but data or a service was
    lost, 130 interrupted, 141 nobody reads the output."""
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
    """
    Raises:
        LindyError, CycloptsError: a mistake of the user.
    """
    program, verbs = "lindy", VERBS
    if words[:1] == ["log"]:
        program, verbs, words = "lindy log", LOG, words[1:]
    if not words or words[0] in HELP:
        groups = GROUPS if verbs is VERBS else {"Commands": LOG}
        print(overview(program, ABOUT if verbs is VERBS else VERBS["log"].help, groups))
        return 0
    if words[0] == "--version":
        print(VERSION)
        return 0
    return _loaded(program, words[0], verbs, helps=not {*HELP}.isdisjoint(words))(
        words, exit_on_error=False, print_error=False, result_action="return_value"
    )


def overview(program: str, about: str, groups: Mapping[str, Mapping[str, Verb]]) -> str:
    """What `--help` says: each verb in one line."""
    blocks = [f"Usage: {program} COMMAND", about]
    width = max(len(name) for verbs in groups.values() for name in verbs)
    for heading, verbs in groups.items():
        lines = [f"  {name:<{width}}  {verb.help}" for name, verb in verbs.items()]
        blocks.append("\n".join([f"{heading}:", *lines]))
    return "\n\n".join([*blocks, f"`{program} COMMAND --help` shows its options.\n{EPILOGUE}"])


def _loaded(program: str, name: str, verbs: Mapping[str, Verb], *, helps: bool) -> Any:
    """A command line of this verb alone. Ctrl-C while it loads is one sentence, as it is later on.

    Args:
        helps: its help will be shown.

    Raises:
        LindyError: there is no such verb.
    """
    if name not in verbs:
        raise LindyError(f"unknown command {name!r}{_meant(name, verbs)} known: {', '.join(verbs)}")
    waiting = signal.getsignal(signal.SIGINT) is signal.default_int_handler  # else it is ignored
    if waiting:
        signal.signal(signal.SIGINT, _leave)
    try:
        from cyclopts import App, Parameter

        formatter = None
        if helps:  # it takes half of a tenth of a second to load
            from tools.flowing_help import FlowingHelp

            formatter = FlowingHelp()
        verb = function_of(name, verbs[name].place)
        app = App(
            name=program,
            help_epilogue=EPILOGUE,
            help_format="plaintext",
            help_formatter=formatter,
            version=VERSION,
            suppress_keyboard_interrupt=False,  # it would be silent
            default_parameter=Parameter(negative=(), show_default=_shown),
        )
        app.command(verb, name=None if isinstance(verb, App) else name)
        return app
    finally:
        if waiting:
            signal.signal(signal.SIGINT, signal.default_int_handler)


def function_of(name: str, place: str) -> Any:
    """The function of a verb.

    Raises:
        LindyError: it is of the package lindy-research, which is not installed.
    """
    from importlib import import_module
    from importlib.metadata import entry_points

    if place:
        module, _, function = place.partition(":")
        return getattr(import_module(f"{__package__}.{module}"), function)
    for entry in entry_points(group="lindy.verbs", name=name):
        return entry.load()
    raise LindyError(
        f"`lindy {name}` is in the package lindy-research, which is not installed; "
        f"in the folder of Lindy's source, `uv run lindy {name}` installs and runs it"
    )


def _shown(default: object) -> str | None:
    """A default in the help, unless it only says that there is nothing."""
    words = str(default)
    return None if words in ("", "None", "True", "False", "inf") or words[0] == "(" else words


def _leave(*_: object) -> None:
    """Nothing has begun that must be ended, and an exception could be raised in the middle of any
    module that is being loaded."""
    os.write(2, b"lindy: interrupted\n")
    os._exit(INTERRUPTED)


def _meant(word: str, verbs: Collection[str]) -> str:
    """`; did you mean 'x'?`, or `;` where nothing is near."""
    from difflib import get_close_matches

    near = get_close_matches(word, verbs, 1)
    return f"; did you mean {near[0]!r}?" if near else ";"


def _mistyped(error: Any) -> str:
    """What is wrong with a command line, by the error of cyclopts."""
    verb = " ".join(("lindy", *(error.command_chain or ())))
    if len(error.command_chain or ()) == 1 and error.command_chain[0] not in VERBS:
        verb = verb.replace("lindy", "lindy log", 1)
    kind, argument, name = type(error).__name__, error.argument, verb.removeprefix("lindy ")
    if kind == "UnusedCliTokensError":
        word, verbs = error.unused_tokens[0], [name for name in error.app or () if name[0] != "-"]
        return (
            f"{name}: {word!r} is not expected{_meant(word, verbs)} `{verb} --help` shows what is"
        )
    if kind == "UnknownOptionError":
        known = [name for known in error.argument_collection or () for name in known.names]
        word = error.token.keyword
        return (
            f"{name}: there is no {word}{_meant(word, known)} `{verb} --help` shows what there is"
        )
    if kind == "MissingArgumentError" and error.keyword is not None:
        minus = f"one that begins with - as {error.keyword}=-1"
        return f"{name}: {error.keyword} needs a value, {minus}; `{verb} --help` shows which"
    if kind == "MissingArgumentError":
        field, missing = argument.field_info, argument.name
        missing = missing if field.is_keyword_only else missing.removeprefix("--").upper()
        return f"{name}: {missing} is missing; `{verb} --help` shows what is expected"
    if kind == "CoercionError" and error.token is not None and error.target_type in NUMBERS:
        wanted = NUMBERS[error.target_type]
        return f"{name}: {argument.name} is {error.token.value!r}, expected {wanted}"
    return str(error)


def _sentence(error: Exception, *, debug: bool) -> str:
    """What to say of an error. With `debug`, all but a mistyped command line are printed, too."""
    import traceback

    if type(error).__module__.startswith("cyclopts."):  # a mistyped verb answers without loading it
        return _mistyped(error)
    if debug:
        traceback.print_exception(error)
    if isinstance(error, LindyError):
        return str(error)
    if isinstance(error, OSError):
        return f"{error.filename or 'operating system'}: {error.strerror or error}"
    if isinstance(error, ImportError) and not isinstance(error, ModuleNotFoundError):
        return f"a library cannot be loaded: {error}; it is damaged, or there is too little memory"
    if isinstance(error, MemoryError):
        return "there is not enough memory for this"
    where = traceback.extract_tb(error.__traceback__)[-1]
    name = where.filename.rpartition("/")[2]
    what = f"{type(error).__name__}: {error}"
    return f"an error in Lindy itself ({DEBUG} shows more), at {name}:{where.lineno}: {what}"


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
