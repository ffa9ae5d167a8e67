"""The verb `lindy calibrate`."""

from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter

from services.marine.vehicle import Vehicle
from services.runtime.config.errors import LindyError
from tools.ask import dive_in
from tools.calibrate.compass import CompassGuide
from tools.calibrate.dvl import DvlGuide
from tools.calibrate.guide import CalibrationGuide, guide_live, replay, table, with_settings
from tools.calibrate.imu import AccelerometerGuide, GyroscopeGuide
from tools.calibrate.noise import noise
from tools.calibrate.pressure import PressureGuide
from tools.choices import RunningDive, named
from tools.fresh import refuse_existing, write_fresh
from tools.identify.results import read_vehicle, vehicle_in
from tools.recordings.recording import open_recording

Sensor = Literal["gyroscope", "accelerometer", "compass", "pressure", "dvl", "noise"]


def calibrate(
    what: Sensor,
    recording: Annotated[
        Path | None, Parameter(help="a dive's folder or its MCAP file; default: the sensors now")
    ] = None,
    /,
    *,
    out: Annotated[
        Path | None, Parameter(converter=named, help="a new vehicle file with the numbers in it")
    ] = None,
    vehicle: Annotated[
        str | None,
        Parameter(
            help="file to begin from; default: that in the recording, or of the running drone"
        ),
    ] = None,
    dive: RunningDive = None,
    atmosphere: Annotated[
        float | None,
        Parameter(help="pressure: [hPa] of a barometer at the place, not reduced to sea level"),
    ] = None,
) -> int:
    """Find the errors of a vehicle's sensors.

    WHAT is `gyroscope` (bias and noise; it lies still for half a minute, of a recording ten seconds
    are enough), `accelerometer` (bias and scale; it is laid on each of its six sides for 5 s),
    `compass` (hard and soft iron; it is turned through all headings), `pressure` (offset, in the
    air), `dvl` (mounting and scale; it surges, sways, stops and turns), or `noise` (of all sensors,
    from a recording of a drone at rest for a minute or longer; `lindy review` of a dive under way
    knows better what the depth's are). Without a recording it guides you, with --dive or the newest
    dive that is going on.

    Example: lindy up drone --out dives/on_the_bench
             lindy calibrate gyroscope --dive dives/on_the_bench --out mine.toml
             lindy calibrate pressure --atmosphere 1009.4 --dive dives/on_the_bench
             lindy calibrate compass dives/latest --out better.toml
    """
    if (atmosphere is None) == (what == "pressure"):
        missing = "`calibrate pressure` needs --atmosphere, [hPa] of a barometer"
        raise LindyError(
            missing if atmosphere is None else "only `calibrate pressure` takes --atmosphere"
        )
    if atmosphere is not None and not 500.0 <= atmosphere <= 1200.0:
        raise LindyError(f"--atmosphere is {atmosphere:g} hPa, expected 500 to 1200 hPa")
    if what == "noise":
        if recording is None or (out, vehicle, dive) != (None, None, None):
            raise LindyError("noise needs a recording, and takes no option")
        return noise(recording)
    guides: dict[str, Callable[[Vehicle], CalibrationGuide]] = {
        "gyroscope": lambda _: GyroscopeGuide(),
        "accelerometer": lambda _: AccelerometerGuide(),
        "compass": lambda vehicle: CompassGuide(vehicle.mounting),
        "pressure": lambda _: PressureGuide(100.0 * (atmosphere or 0.0)),
        "dvl": DvlGuide,
    }
    if recording is not None and dive is not None:
        raise LindyError("give a recording, or --dive for the sensors now, not both")
    if out is not None:
        refuse_existing(out)
    if recording is not None:
        opened = open_recording(recording)
        name, text = vehicle_in(opened, vehicle)
        guide = guides[what](read_vehicle(name, text))
        replay(opened, guide)
        source, damage = recording.resolve().name, opened.damage
    else:
        running = dive_in(dive)
        name, text = vehicle_in(None, vehicle or running.vehicle)
        guide = guides[what](read_vehicle(name, text))
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
