"""The verb `lindy calibrate`."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from cyclopts import App, Parameter

from services.marine.vehicle import Vehicle
from services.runtime.config.errors import LindyError
from tools.ask import dive_in
from tools.calibrate.compass import CompassGuide
from tools.calibrate.dvl import DvlGuide
from tools.calibrate.guide import CalibrationGuide, guide_live, replay
from tools.calibrate.imu import AccelerometerGuide, GyroscopeGuide
from tools.calibrate.noise import noise
from tools.calibrate.pressure import PressureGuide
from tools.calibrate.results import table, with_settings
from tools.choices import RunningDive, named
from tools.fresh import refuse_existing, write_fresh
from tools.identify.vehicle_file import read_vehicle, vehicle_in
from tools.recordings.recording import open_recording

calibrate = App(
    name="calibrate",
    help="Find the errors of a vehicle's sensors.",
)
calibrate.command(noise)

RecordingArgument = Annotated[
    Path | None, Parameter(help="a dive's folder or its MCAP file; default: the sensors now")
]


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class CalibrationOptions:
    """Options that all calibrations share."""

    out: Annotated[
        Path | None, Parameter(converter=named, help="a new vehicle file with the numbers in it")
    ] = None
    vehicle: Annotated[
        str | None,
        Parameter(
            help="file to begin from; default: that in the recording, or of the running drone"
        ),
    ] = None
    dive: RunningDive = None


NO_OPTIONS = CalibrationOptions()


@calibrate.command
def gyroscope(
    recording: RecordingArgument = None, /, *, options: CalibrationOptions = NO_OPTIONS
) -> int:
    """Bias and noise of the gyroscope, of a vehicle that lies still for half a minute.

    Of a recording ten seconds are enough.

    Example: lindy up drone --out dives/on_the_bench
             lindy calibrate gyroscope --dive dives/on_the_bench --out mine.toml
    """
    return _calibrate(lambda _: GyroscopeGuide(), recording, options)


@calibrate.command
def accelerometer(
    recording: RecordingArgument = None, /, *, options: CalibrationOptions = NO_OPTIONS
) -> int:
    """Bias and scale of the accelerometer, of a vehicle laid on each of its six sides for 5 s.

    Example: lindy calibrate accelerometer --dive dives/on_the_bench --out mine.toml
    """
    return _calibrate(lambda _: AccelerometerGuide(), recording, options)


@calibrate.command
def compass(
    recording: RecordingArgument = None, /, *, options: CalibrationOptions = NO_OPTIONS
) -> int:
    """Hard and soft iron around the magnetometer, of a vehicle turned through all headings.

    Example: lindy calibrate compass dives/latest --out mine.toml
    """
    return _calibrate(lambda v: CompassGuide(v.mounting), recording, options)


@calibrate.command
def pressure(
    recording: RecordingArgument = None,
    /,
    *,
    atmosphere: Annotated[
        float, Parameter(help="[hPa] of a barometer at the place, not reduced to sea level")
    ],
    options: CalibrationOptions = NO_OPTIONS,
) -> int:
    """Offset of the pressure sensor, in the air.

    Example: lindy calibrate pressure --atmosphere 1009.4 --dive dives/on_the_bench
    """
    if not 500.0 <= atmosphere <= 1200.0:
        raise LindyError(f"--atmosphere is {atmosphere:g} hPa, expected 500 to 1200 hPa")
    return _calibrate(lambda _: PressureGuide(100.0 * atmosphere), recording, options)


@calibrate.command
def dvl(recording: RecordingArgument = None, /, *, options: CalibrationOptions = NO_OPTIONS) -> int:
    """How a DVL is mounted, and its scale, of a dive that surges, sways, stops and turns.

    Example: lindy dive --vehicle mine.toml --pilot script:dvl_check
             lindy calibrate dvl dives/latest --out better.toml
    """
    return _calibrate(DvlGuide, recording, options)


def _calibrate(
    guide_of: Callable[[Vehicle], CalibrationGuide],
    recording: Path | None,
    options: CalibrationOptions,
) -> int:
    """Guide the calibration, print what was found, and write it.

    Raises:
        LindyError: the samples do not tell, or the file cannot be written.
    """
    out = options.out
    if recording is not None and options.dive is not None:
        raise LindyError("give a recording, or --dive for the sensors now, not both")
    if out is not None:
        refuse_existing(out)
    if recording is not None:
        opened = open_recording(recording)
        name, text = vehicle_in(opened, options.vehicle)
        guide = guide_of(read_vehicle(name, text))
        replay(opened, guide)
        source, damage = recording.resolve().name, opened.damage
    else:
        running = dive_in(options.dive)
        name, text = vehicle_in(None, options.vehicle or running.vehicle)
        guide = guide_of(read_vehicle(name, text))
        guide_live(running, guide, lambda line: print(line, flush=True))
        source, damage = "the running vehicle", list[str]()
    found = guide.result()
    remarks = *found.remarks, *damage
    print("\n".join([table(found.settings), "", *(f"# {remark}" for remark in remarks)]))
    if out is not None:
        text = with_settings(name, text, found.settings, f"from {source}")
        write_fresh(out, text.encode())
        print(f"\nwritten {out}")
    return 0
