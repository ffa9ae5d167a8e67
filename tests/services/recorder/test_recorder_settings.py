"""The table [recorder] of a vehicle file, on virtual time, writing real files."""

from pathlib import Path

import pytest
from mcap.reader import make_reader

from services.runtime.config.errors import LindyError
from services.runtime.config.stack import Stack
from services.runtime.hosts.stack_file import ServiceSpec
from services.runtime.hosts.virtual_host import VirtualHost
from tools.recordings.recording import log_hash

SECOND = 1_000_000_000
HOME = ServiceSpec(["drone"])


@pytest.mark.parametrize("wrong", ["foxglove=3", "ring=5"])
def test_a_wrong_setting_is_one_sentence_that_names_it(tmp_path: Path, wrong: str):
    stack = Stack(out=str(tmp_path), overrides=[f"recorder.{wrong}"])
    with pytest.raises(LindyError, match=rf"--set recorder\.{wrong}"):
        VirtualHost().add("recorder", HOME, stack)
    assert list(tmp_path.iterdir()) == []


def test_without_foxglove_only_messages_are_recorded(tmp_path: Path):
    keys: list[set[str]] = []
    for name, settings in (("plain", ["recorder.foxglove=false"]), ("both", [])):
        host = VirtualHost()
        neighbour = host.node("neighbour", ["drone"])
        host.add("recorder", HOME, Stack(out=str(tmp_path / name), overrides=settings))
        neighbour.log("info", "words")
        host.run(SECOND)
        host.close()
        with (tmp_path / name / "dive.mcap").open("rb") as stream:
            summary = make_reader(stream).get_summary()
        assert summary is not None
        keys.append({channel.topic for channel in summary.channels.values()})
    assert keys[1] - keys[0] == {"foxglove/log"}
    assert log_hash(tmp_path / "plain") == log_hash(tmp_path / "both")
