"""The `lindy` command: which verbs there are, and what it says where one fails. Each verb imports
what it needs only when it is called, so that `--help` and a mistyped command answer at once."""

import os
import select
import sys
import traceback
from collections.abc import Callable, Sequence
from importlib.metadata import version
from pathlib import Path

from cyclopts import App, CycloptsError

from services.runtime.config.errors import LindyError
from tools.calibrate.command import calibrate
from tools.doctor.command import doctor
from tools.gains import gains
from tools.identify.command import identify
from tools.keys.command import keys
from tools.link import link
from tools.pad.command import pad
from tools.profile import profile
from tools.ramp import ramp
from tools.sweep.command import sweep
from tools.verbs import analyse, fleet, live, replay, research, start
from tools.verbs.log import log

ERROR, INTERRUPTED = 1, 130  # exit statuses
UNREAD = 141  # exit status: nobody reads the output any more; that of a program that SIGPIPE ends
DEBUG = "--debug"
PAPERS = "tools.research"  # not in an installed package

app = App(
    name="lindy",
    help="Pilot an underwater drone: the pilot leads, the drone follows, without a jerk.",
    help_epilogue="With --debug before or after any verb, an error shows where it came from.",
    help_format="plaintext",
    version=lambda: version("lindy"),
    suppress_keyboard_interrupt=False,  # it would be silent
)

app.command(start.dive)
app.command(start.up)
app.command(fleet.fly)
app.command(fleet.drones)
app.command(fleet.fleet)
app.command(fleet.record)
app.command(fleet.router_config)
app.command(start.simulate)
app.command(start.run)
app.command(start.hub)
app.command(analyse.picture)
app.command(analyse.path)
app.command(replay.replay)
app.command(live.ask)
app.command(live.fault)
app.command(log)
app.command(research.bench)
app.command(research.figures)
app.command(profile)
app.command(ramp)
app.command(gains)
app.command(identify)
app.command(doctor)
app.command(calibrate)
app.command(link)
app.command(pad)
app.command(sweep)
app.command(keys)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a verb. Returns the exit status: 0 clean, 1 error, 3 done but data or a service was
    lost, 130 interrupted, 141 nobody reads the output."""
    words = [*(sys.argv[1:] if arguments is None else arguments)]
    if DEBUG not in words:
        return _run(words)
    return _run([word for word in words if word != DEBUG], explain=traceback.print_exc)


def _run(words: Sequence[str], explain: Callable[[], None] = lambda: None) -> int:
    """`explain` is called for every error but a mistyped command line."""
    try:
        status = app(words, exit_on_error=False, print_error=False, result_action="return_value")
        sys.stdout.flush()  # here, where it may fail
    except CycloptsError as error:
        return complain(str(error))
    except LindyError as error:
        explain()
        return complain(str(error))
    except KeyboardInterrupt:
        complain("interrupted")
        return INTERRUPTED
    except SystemExit as ended:  # rich ends the program where nobody reads
        if isinstance(ended.__context__, BrokenPipeError):
            return UNREAD
        raise
    except OSError as error:
        if isinstance(error, BrokenPipeError) and _nobody_reads():
            return UNREAD
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


def _nobody_reads() -> bool:
    """Has whoever read the output ended, as `head` does? Then nothing more is written to it, not
    even by Python as it ends."""
    output = select.poll()
    output.register(sys.stdout, select.POLLOUT)
    if not any(events & select.POLLERR for _, events in output.poll(0)):
        return False
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    return True


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
