"""`lindy simulate --from`: the dive of a recording, from nothing but that recording."""

from contextlib import ExitStack
from pathlib import Path
from tempfile import TemporaryDirectory

import msgspec

from messages.text import harmless
from services.recorder.io.attachments import computer, lindy
from services.runtime.config.errors import LindyError
from services.runtime.config.settings import reading_copies
from services.runtime.config.stack import SCRIPT
from services.runtime.hosts.registry import Registry
from tools.choices import Choices
from tools.live.cockpit import COCKPIT
from tools.live.pilots import GAMEPAD
from tools.log.sticks import as_csv, sticks_of
from tools.recordings.dive_file import FlownDive, flown_dive, unpacked
from tools.recordings.recording import Recording, open_recording
from tools.simulate import Simulated, simulated
from tools.start import foreign

STICKS = "recorded.csv"  # the stick log made of a dive that no script flew


def fly_again(path: Path, choices: Choices, *, files: bool = True, trust: bool = False) -> int:
    """Fly the dive of a recording again on virtual time, and compare the hash of everything that
    was recorded. Returns the exit status.

    Args:
        path: a dive's folder, or its MCAP file.
        choices: only `out` may be given; everything else is in the recording.
        trust: also code that is not Lindy's own, which the recording names.

    Raises:
        LindyError: the recording does not say enough, or the dive was not the same.
    """
    _require_nothing_else(choices)
    recording = open_recording(path)
    dive = flown_dive(recording)
    if dive is None:
        recording.require_messages()
        raise LindyError(
            f"{path} does not say how it was flown: it was recorded before Lindy attached that, "
            f"or not by Lindy"
        )
    before = recording.metadata("hash").get("sha256")
    with ExitStack() as exits:
        folder = Path(exits.enter_context(TemporaryDirectory(prefix="lindy-")))
        pilot = _pilot(dive, recording, folder)
        exits.enter_context(reading_copies(unpacked(recording, dive.files, folder)))
        again = msgspec.structs.replace(dive.stack, pilot=pilot)
        if not trust and (names := foreign(Registry.read(again.services))):
            raise LindyError(  # whoever made a recording must not run code here by that
                f"{path} would run code that is not Lindy's own: {', '.join(names)}; with --trust "
                f"it does"
            )
        # What a browser's pilot did is a script by now, which the gamepad plays.
        running = [GAMEPAD if name == COCKPIT else name for name in again.running]
        flown = simulated(
            Choices(
                pilot=again.pilot,
                vehicle=again.vehicle,
                stack=again.services,
                link=again.link,
                seconds=again.seconds,
                out=choices.out,
                seed=again.seed,
                set_=tuple(again.overrides),
            ),
            files=files,
            running=running,
        )
    return _judged(recording, path, dive, before, flown, changed=pilot != dive.stack.pilot)


def _require_nothing_else(choices: Choices) -> None:
    defaults = Choices(out=choices.out)
    for name in ("pilot", "vehicle", "stack", "link", "seconds", "seed", "set_"):
        if getattr(choices, name) != getattr(defaults, name):
            option = name.rstrip("_")
            raise LindyError(
                f"--{option}: with --from everything but --out is as the recording says; drop it"
            )


def _pilot(dive: FlownDive, recording: Recording, folder: Path) -> str:
    """The script of the dive; where there was none, or it is not in the recording, the recorded
    sticks."""
    pilot = dive.stack.pilot
    if pilot.startswith(SCRIPT):
        file = dive.named("dives", pilot.removeprefix(SCRIPT), ".csv")
        if file is not None and file.attachment is not None:
            return pilot
    sticks = sticks_of(recording, f"{folder}/")
    for name, text in sticks.paths.items():
        Path(name).write_text(text, encoding="utf-8")
    path = folder / STICKS
    path.write_text(as_csv(sticks, f"the sticks of {sticks.source}"), encoding="utf-8")
    said = f"no script in the recording: its sticks, of {sticks.source}, are flown"
    print(harmless("\n".join([said, *sticks.remarks])), flush=True)
    return f"{SCRIPT}{path}"


def _judged(
    recording: Recording,
    path: Path,
    dive: FlownDive,
    before: str | None,
    flown: Simulated,
    *,
    changed: bool,
) -> int:
    """The exit status.

    Raises:
        LindyError: the dive was not the same.
    """
    if not dive.stack.virtual or changed:
        why = "its script is not in the recording"
        if not dive.stack.virtual:
            why = "it was flown by the clock, so it is not the same twice"
        print(f"log hash          not compared: {why}", flush=True)
        return flown.status
    if before is None or flown.log_hash is None:
        which = path if before is None else flown.folder
        raise LindyError(f"the log hashes cannot be compared: {which} was not finished")
    if before == flown.log_hash:
        for _ in recording.raw(lambda _: False):
            pass
        if recording.damage:
            raise LindyError(
                f"the log hash is the one that was recorded, but {recording.damage[0]}"
            )
        print(f"log hash          the same as in {path}: {before[:16]}…", flush=True)
        return flown.status
    why = (
        "with the same Lindy on the same kind of computer: was it interrupted, or the code changed?"
    )
    if differences := dive.differences(lindy(), computer()):
        why = f"it was recorded with {'; '.join(differences)}"
    if flown.folder is not None:
        why += f"; `lindy log compare {path} {flown.folder}` shows where"
    raise LindyError(
        f"the log hash is not the same as in {path} ({before[:16]}…, now "
        f"{flown.log_hash[:16]}…): {why}"
    )
