"""A short dive with files of its own: vehicle, link with a trace, script with a path and a link."""

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import pytest
from mcap.records import Attachment, Channel

from services.runtime.config.settings import DEPLOY
from services.runtime.hosts.registry import Registry
from tools.choices import Choices
from tools.recordings.mcap_copy import new_mcap
from tools.recordings.mcap_records import Damage, StoredMessage, salvaged
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
SERVICES = [name for name in Registry.read() if name != "visualizer"]  # its libraries are slow


class ShortDive(NamedTuple):
    folder: Path  # of the recording
    log_hash: str
    script: str


@pytest.fixture(scope="session")
def dive(tmp_path_factory: pytest.TempPathFactory) -> ShortDive:
    """Over a bad link. The files that it was flown with are gone."""
    return flown(tmp_path_factory, "first.toml")


@pytest.fixture(scope="session")
def clean_dive(tmp_path_factory: pytest.TempPathFactory) -> ShortDive:
    """The same over a link that loses nothing."""
    return flown(tmp_path_factory, "clean.toml")


def flown(tmp_path_factory: pytest.TempPathFactory, link: str) -> ShortDive:
    files = tmp_path_factory.mktemp("files")
    bad = "second" if link == "first.toml" else "clean"
    own = {
        "my_drone.toml": (DEPLOY / "vehicles" / "pioneer.toml").read_text(),
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
        out=tmp_path_factory.mktemp("recorded") / "dive",
    )
    done = simulated(choices, running=SERVICES)
    for name in own:
        (files / name).unlink()
    assert done.folder is not None
    assert done.log_hash is not None
    return ShortDive(done.folder, done.log_hash, own["script.csv"])


Alter = Callable[[str, StoredMessage], StoredMessage | None]


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
        for record in salvaged(dive.folder / "dive.mcap", Damage()):
            if isinstance(record, Channel):
                keys[record.id] = record.topic
            elif isinstance(record, Attachment):
                record.data = attached(record.name, record.data)
            if isinstance(record, StoredMessage):
                if (other := alter(keys[record.channel_id], record)) is not None:
                    copy.add(other)
            else:
                copy.add(record)
    return out
