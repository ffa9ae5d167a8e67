"""A sign of life in a file: what was written last is read, and no file is no error."""

from pathlib import Path

from services.runtime.hosts.heartbeat import Heartbeat, last_beat


def test_the_newest_beat_is_read(tmp_path: Path) -> None:
    path = tmp_path / "control.beat"
    assert last_beat(path) is None
    heartbeat = Heartbeat(path)
    assert last_beat(path) is None
    for now in (1, 2**62, 5):
        heartbeat.beat(now)
        assert last_beat(path) == now


def test_a_new_life_begins_without_a_beat(tmp_path: Path) -> None:
    path = tmp_path / "control.beat"
    Heartbeat(path).beat(7)
    Heartbeat(path)
    assert last_beat(path) is None


def test_where_no_file_can_be_made_nothing_is_watched_and_nothing_fails(tmp_path: Path) -> None:
    path = tmp_path / "no such folder" / "control.beat"
    heartbeat = Heartbeat(path)
    heartbeat.beat(7)
    assert heartbeat.unwatched.startswith("nobody would notice if it hung: cannot write ")
    assert Heartbeat(None).unwatched == ""
    assert last_beat(path) is None
