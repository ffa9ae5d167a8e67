"""Recorded dives, each flown once in a run of the tests: they are only read."""

from functools import partial
from pathlib import Path

import pytest

from tests.support import recorded
from tests.support.once import once
from tests.support.recorded import ShortDive
from tools.log.film import FilmedPicture, pictures
from tools.recordings.recording import open_recording


@pytest.fixture(scope="session")
def dive(tmp_path_factory: pytest.TempPathFactory, worker_id: str) -> ShortDive:
    """Over a bad link."""
    fly = partial(recorded.fly_short_dive, link="first.toml")
    return recorded.short_dive(once(tmp_path_factory, worker_id, "short", fly))


@pytest.fixture(scope="session")
def clean_dive(tmp_path_factory: pytest.TempPathFactory, worker_id: str) -> ShortDive:
    """The same over a link that loses nothing."""
    fly = partial(recorded.fly_short_dive, link="clean.toml")
    return recorded.short_dive(once(tmp_path_factory, worker_id, "short_clean", fly))


@pytest.fixture(scope="session")
def filmed_dive(tmp_path_factory: pytest.TempPathFactory, worker_id: str) -> Path:
    return once(tmp_path_factory, worker_id, "filmed", recorded.fly_filmed_dive) / "dive"


@pytest.fixture(scope="session")
def filmed_pictures(filmed_dive: Path) -> list[FilmedPicture]:
    return list(pictures(open_recording(filmed_dive)))


@pytest.fixture(scope="session")
def whole_dive(tmp_path_factory: pytest.TempPathFactory, worker_id: str) -> Path:
    return once(tmp_path_factory, worker_id, "whole", recorded.fly_whole_dive)


@pytest.fixture(scope="session")
def severe_dive(tmp_path_factory: pytest.TempPathFactory, worker_id: str) -> Path:
    return once(tmp_path_factory, worker_id, "severe", recorded.fly_severe_dive) / "dive"
