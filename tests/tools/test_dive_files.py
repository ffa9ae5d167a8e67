"""What a recording has to carry besides vehicle, link and script is found."""

import json
from pathlib import Path
from typing import Any

import pytest

from messages.link import LinkRequest
from services.recorder.io.attachments import DIVE, attachments
from services.runtime.config.settings import DEPLOY, reading_copies
from services.runtime.config.stack import Stack
from tools.checks import read_besides


def test_a_person_flies_with_a_pad_profile() -> None:
    for pilot in ("gamepad", "keyboard"):
        assert read_besides(Stack(pilot=pilot), (), ()) == [str(DEPLOY / "pads" / "default.toml")]
    assert read_besides(Stack(pilot="script:first_dive"), (), ()) == []


def test_a_script_brings_its_links_with_their_traces_and_its_paths(tmp_path: Path) -> None:
    trace, link = tmp_path / "pool.csv", tmp_path / "pool.toml"
    trace.write_text("sent_s,arrived_s\n0,0.1\n")
    link.write_text('[up]\ndelay = {kind = "trace", file = "pool.csv"}\n')
    to_pool = LinkRequest(stamp_ns=0, id="", kind="profile", profile=str(link))
    unknown = LinkRequest(stamp_ns=0, id="", kind="profile", profile="nowhere")
    stack = Stack(pilot="script:first_dive", link="severe")
    found = read_besides(stack, (to_pool, unknown, to_pool), ("survey",))
    assert found == [str(link), str(trace), str(DEPLOY / "paths" / "survey.toml")]


def test_what_has_gone_is_named_and_the_rest_is_attached(tmp_path: Path) -> None:
    stack = Stack(pilot="script:first_dive", read_besides=[str(tmp_path / "gone.csv")])
    about, *files = attachments(stack)
    assert about.name == DIVE
    names = ["pioneer.toml", "tether.toml", "first_dive.csv", "simulated.toml"]
    assert [each.name for each in files] == names
    rows = {row["path"]: row for row in json.loads(about.data)["files"]}
    assert rows[str(tmp_path / "gone.csv")]["attachment"] is None
    assert rows["vehicles/pioneer.toml"]["shipped"]


def test_two_files_of_one_name_are_both_attached(tmp_path: Path) -> None:
    for folder in ("a", "b"):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "trace.csv").write_text(folder)
    besides = [str(tmp_path / folder / "trace.csv") for folder in ("a", "b")]
    found = {each.name: each.data for each in attachments(Stack(read_besides=besides))}
    assert (found["trace.csv"], found["trace-2.csv"]) == (b"a", b"b")


@pytest.mark.parametrize("name", ["pioneer", "minerva"])
def test_a_copy_is_read_in_place_of_a_file_that_has_changed(tmp_path: Path, name: str) -> None:
    """As a recorder that starts again in mid-dive reads it; also the settings that it gives."""
    path, copy = DEPLOY / "vehicles" / f"{name}.toml", tmp_path / "0"
    copy.write_text(path.read_text() + "\n[gamepad]\npilot = 'ann'\n")
    stack = Stack(vehicle=name)
    before = stack.section("gamepad", dict[str, Any])
    with reading_copies({str(path): str(copy)}):
        assert attachments(stack)[1].data == copy.read_bytes()
        assert Stack(vehicle=name).section("gamepad", dict[str, Any])["pilot"] == "ann"
    assert Stack(vehicle=name).section("gamepad", dict[str, Any]) == before
