"""Short recorded dives that many tests read; `once` flies each one time in a run of the tests."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from mcap.reader import make_reader
from mcap.records import Attachment, Channel

from services.runtime.config.settings import DEPLOY
from services.runtime.hosts.registry import Registry
from tests.golden.dives import flown
from tools.choices import Choices
from tools.recordings.mcap_copy import new_mcap
from tools.recordings.mcap_records import Raw, records
from tools.simulate import simulated

SCRIPT = """t,surge,sway,heave,yaw,tilt,event
0,0,0,0,0,0,
0.3,0,0,0.5,0.25,0,light
0.613,0.3,0,-0.125,0,0.5,
0.8,0,0,0,0,0,link profile {folder}/{second}.toml
0.9,0,0,0,0,0,goto depth=1.5 heading=33.3
1.2,0,0,0,0,0,fault pressure noisy 1.5
1.3,0,0,0,0,0,mode depth_hold
1.4,0,0,0.1,0,0,
1.5,0,0,0,0,0,follow {folder}/box.toml
1.7,0,0,0,0,0,
"""
LINK = '[down]\ndelay = {{kind = "trace", file = "{}"}}\nduplicate = 0.1\ncorrupt = 0.02\n'
QUICK = "estimation.calibration.still_time=1"


def without_viewer(stack: str = "simulated") -> list[str]:
    """All services but the one whose libraries are slow."""
    return [name for name in Registry.read(stack) if name != "visualizer"]


class ShortDive(NamedTuple):
    """With files of its own: vehicle, link with a trace, script with a path and a link. The files
    that it was flown with are gone."""

    folder: Path  # of the recording
    log_hash: str
    script: str


def fly_short_dive(folder: Path, link: str) -> None:
    """
    Args:
        link: `first.toml`, a bad one; `clean.toml` loses nothing.
    """
    files = folder / "files"
    files.mkdir()
    bad = "second" if link == "first.toml" else "clean"
    own = {
        "my_drone.toml": (DEPLOY / "vehicles" / "pioneer.toml")
        .read_text()
        .replace('name = "Pioneer"', 'name = "My drone"', 1),
        "first.toml": LINK.format("first.csv"),
        "first.csv": "sent_s,arrived_s\n0,0.01\n0.1,0.12\n0.2,\n0.31,0.33\n",
        "second.toml": LINK.format("second.csv"),
        "second.csv": "sent_s,arrived_s\n0,0.02\n0.1,0.12\n",
        "clean.toml": "[down]\ndelay_ms = 1.0\n",
        "box.toml": (DEPLOY / "paths" / "inspection_box.toml").read_text(),
        "script.csv": SCRIPT.format(folder=files, second=bad),
    }
    for name, text in own.items():
        (files / name).write_text(text)
    choices = Choices(
        pilot=f"script:{files}/script.csv",
        vehicle=f"{files}/my_drone.toml",
        link=f"{files}/{link}",
        seed=7,
        set_=(QUICK, "control.depth.kp=3"),
        out=folder / "dive",
    )
    done = simulated(choices, running=without_viewer())
    for name in own:
        (files / name).unlink()
    (folder / "about.json").write_text(json.dumps([done.log_hash, own["script.csv"]]))


def short_dive(folder: Path) -> ShortDive:
    """What `fly_short_dive` left in this folder."""
    return ShortDive(folder / "dive", *json.loads((folder / "about.json").read_text()))


def fly_filmed_dive(folder: Path) -> None:
    """With a camera over a link that makes its bitrate change."""
    choices = Choices(
        pilot="script:first_dive", stack="camera", link="wifi_buoy", seconds=6.0,
        out=folder / "dive", set_=(QUICK, "simulator.floor_depth=8"),
    )  # fmt: skip
    simulated(choices, running=without_viewer("camera"))


def fly_whole_dive(folder: Path) -> None:
    """Twelve seconds from power-on: calibration, all axes, and a stop; Minerva has every sensor."""
    flown("minerva", folder, without_viewer(), seed=5, seconds=12.0)


def fly_severe_dive(folder: Path) -> None:
    """Over a link so bad that the pilot is lost."""
    choices = Choices(
        link="severe", seed=1, seconds=12.0, pilot="script:first_dive", out=folder / "dive"
    )
    simulated(choices, running=without_viewer())


Alter = Callable[[str, Raw], Raw | None]


def rewritten(
    dive: ShortDive,
    out: Path,
    alter: Alter = lambda _, message: message,
    attached: Callable[[str, bytes], bytes] = lambda _, data: data,
) -> Path:
    """A copy with what `alter` makes of each message of a key, None: nothing; and with other
    attached files."""
    keys: dict[int, str] = {}
    with new_mcap(out) as copy:
        copy.next_file()
        for record in records(dive.folder / "dive.mcap"):
            if isinstance(record, Channel):
                keys[record.id] = record.topic
            elif isinstance(record, Attachment):
                record.data = attached(record.name, record.data)
            if isinstance(record, Raw):
                if (other := alter(keys[record.channel_id], record)) is not None:
                    copy.add(other)
            else:
                copy.add(record)
    return out


def foreign(path: Path) -> list[tuple[str, int, int, int, bytes]]:
    """Every message, as a reader of others finds it."""
    with path.open("rb") as stream:
        return [
            (channel.topic, m.log_time, m.publish_time, m.sequence, m.data)
            for _, channel, m in make_reader(stream).iter_messages(log_time_order=False)
        ]
