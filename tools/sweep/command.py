"""The verb `lindy sweep`."""

from tools.choices import NewFile, NewPicture, Overrides, StackName, Whole
from tools.sweep.axes import axes
from tools.sweep.sweep import Wanted
from tools.sweep.sweep import sweep as fly

Values = tuple[str, ...]


def sweep(
    *,
    out: NewFile,
    seed: Values = ("0",),
    set_: Overrides = (),
    vehicle: Values = ("pioneer",),
    link: Values = ("tether",),
    pilot: Values = ("script:first_dive",),
    stack: StackName = "simulated",
    seconds: float | None = None,
    workers: Whole | None = None,
    record: bool = False,
    picture: NewPicture = None,
) -> int:
    """Simulate many dives on all cores, into one table.

    One row of figures per dive. The options are those of `lindy simulate`, with several values
    between commas where wanted. The sweep is their product. A dive has neither files nor a viewer.
    After an interruption the same command goes on with what is missing.

    Example: lindy sweep --seed 1..100 --set control.depth.kp=20,40 --out kp.csv
             lindy sweep --vehicle pioneer,minerva --link tether,severe --seed 1..20 --out v.parquet

    Parameters
    ----------
    out
        the table: .csv, or .parquet with the extra `tables`; the finished dives are beside it
    seed
        of everything random in simulator and link: 7, 1,2,5 or 1..100
    set_
        key.path=value,value into the vehicle file; repeatable
    vehicle
        names in deploy/vehicles, or paths of TOML files
    link
        names in deploy/links, or paths of TOML files
    pilot
        script:FILE (a CSV stick log)
    stack
        which services: a name in deploy/stacks, or the path of a TOML file
    seconds
        end each dive this long after arming
    workers
        processes; default: one for each core
    record
        keep a folder with recording and report of each dive, beside the table
    picture
        a new PNG: the main figures of each combination of the axes
    """
    wanted = Wanted(
        out=out, stack=stack, seconds=seconds, workers=workers, record=record, picture=picture
    )
    return fly(axes(vehicle, link, pilot, set_, seed), wanted)
