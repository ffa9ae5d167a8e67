"""The same sticks on the identified vehicle, with Lindy in control: its stops, simulated."""

from contextlib import redirect_stdout
from io import StringIO
from pathlib import Path
from tempfile import TemporaryDirectory

import msgspec

from services.runtime.config.errors import LindyError
from services.runtime.hosts.registry import Registry
from tools.choices import Choices
from tools.identify.command import identify_dive
from tools.identify.results import identified, rewritten, rounded
from tools.live.cockpit import VIEWER
from tools.log.sticks import as_csv, sticks_of
from tools.recordings.recording import open_recording
from tools.review.recorded import read
from tools.review.stops import ReviewedStop, reviewed_stops
from tools.simulate import simulated


def stops_with_lindy(path: Path, begin_ns: int) -> list[ReviewedStop] | str:
    """
    Args:
        begin_ns: [ns] of this recording, from which times count, by the clock of its stamps.

    Returns:
        A sentence: what is missing in this recording for it.
    """
    try:
        found = identify_dive(path)
        vehicle = rounded(identified(found.fit, found.start))
        text = rewritten(found.file, vehicle, "identified")
        with TemporaryDirectory(prefix="lindy-") as name:
            folder = Path(name)
            file, script = folder / "identified.toml", folder / "sticks.csv"
            file.write_text(text, encoding="utf-8")
            sticks = sticks_of(open_recording(path), f"{folder}/")
            for each, course in sticks.paths.items():
                Path(each).write_text(course, encoding="utf-8")
            script.write_text(as_csv(sticks, "the recorded sticks"), encoding="utf-8")
            choices = Choices(pilot=f"script:{script}", vehicle=str(file), out=folder / "dive")
            with redirect_stdout(StringIO()):
                simulated(choices, running=[each for each in Registry.read() if each != VIEWER])
            flown = read(folder / "dive")
            # Both tables count from the beginning of the reviewed recording.
            again = sticks_of(flown.source.recording)
            later = (sticks.began_ns - begin_ns - again.began_ns + flown.begin_ns) / 1e9
    except LindyError as error:
        return f"Lindy on this vehicle cannot be simulated from this dive: {error}."
    stops = reviewed_stops(
        flown.dive, flown.own, flown.sensors.get("sensor/imu"), flown.settings.reference,
        flown.armed,
    ).stops  # fmt: skip
    return [msgspec.structs.replace(stop, t=round(stop.t + later, 3)) for stop in stops]
