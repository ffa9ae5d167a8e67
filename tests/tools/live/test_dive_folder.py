"""Nothing of the user's is ever deleted or overwritten, whatever a dive is told to do."""

import os
import socket
import subprocess
import sys
from collections.abc import Sequence
from hashlib import sha256
from pathlib import Path

import pytest
from cyclopts import Token

from services.runtime.config.errors import LindyError
from tools.__main__ import main
from tools.choices import named
from tools.fresh import write_fresh
from tools.live.dive_folder import holds_dive, out_folder, point_latest

SCRIPT = "t,surge,sway,heave,yaw\n0,0,0,0,0\n1,0,0,0.5,0\n2,0,0,0,0\n"
THEIRS = ("dive_fjord_2025.mcap", "diver_photos.rrd", "report.json.bak", ".lindy", "notes/a.log")
OF_A_DIVE = (
    "dive.mcap", "dive.rrd", "dive.part2.mcap", "dive.part7.rrd", "merging.mcap", "report.json",
    "run.json", "logs/ship.log", "logs",
)  # fmt: skip


def fill(folder: Path, names: Sequence[str]) -> None:
    for name in names:
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(f"the user's own {name}".encode())


def hashes(folder: Path) -> dict[str, str]:
    files = [path for path in folder.rglob("*") if path.is_file()]
    return {str(p.relative_to(folder)): sha256(p.read_bytes()).hexdigest() for p in files}


def simulate(tmp_path: Path, *options: str) -> int:
    script = tmp_path / "sticks.csv"
    script.write_text(SCRIPT)
    quick = ("--set", "estimation.calibration.still_time=1", "--seconds", "1")
    return main(["simulate", "--pilot", f"script:{script}", *quick, *options])


@pytest.mark.parametrize("name", OF_A_DIVE)
def test_a_folder_with_any_file_of_a_dive_stays_as_it_is(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, name: str
):
    out = tmp_path / "fjord"
    fill(out, (*THEIRS, name))
    before = hashes(out)
    assert out_folder(out) == tmp_path / "fjord-2"
    assert out_folder(out) == tmp_path / "fjord-3"
    assert hashes(out) == before
    said = f"{out} holds a dive already; this one goes to {tmp_path / 'fjord-2'}\n"
    assert capsys.readouterr().out.startswith(said)


def test_a_dive_among_other_people_s_files_touches_none_of_them(tmp_path: Path):
    out = tmp_path / "data"
    fill(out, THEIRS)
    (out / "logs").mkdir()
    before = hashes(out)
    assert simulate(tmp_path, "--out", str(out)) == 0
    after = hashes(out)
    assert {name: after[name] for name in before} == before
    assert set(after) - set(before) == {"dive.mcap", "dive.rrd", "report.json"}


@pytest.mark.slow
@pytest.mark.parametrize("verb", [("dive", "--headless"), ("up", "drone")])
@pytest.mark.parametrize("taken", [True, False])
def test_a_dive_that_cannot_start_costs_nothing_and_leaves_nothing(
    tmp_path: Path, verb: tuple[str, ...], taken: bool
):
    with socket.create_server(("127.0.0.1", 0)) as server:
        endpoint = f"tcp/127.0.0.1:{server.getsockname()[1]}" if taken else "foo"
        check_that_nothing_changes(tmp_path, verb, endpoint)


def check_that_nothing_changes(tmp_path: Path, verb: tuple[str, ...], endpoint: str) -> None:
    fill(tmp_path / "old", (*THEIRS, *OF_A_DIVE[:-1]))
    (tmp_path / "empty").mkdir()
    before = hashes(tmp_path)
    for out in ("old", "new/deep", "empty", "dives/x"):
        command = [*verb, "--pilot", "script:first_dive", "--listen", endpoint, "--out", out]
        ran = subprocess.run(
            [sys.executable, "-P", "-m", "tools", *command],
            cwd=tmp_path,
            env={**os.environ, "PYTHONPATH": str(Path(__file__).parents[2])},
            capture_output=True,
            text=True,
            check=False,
        )
        assert ran.returncode == 1
        assert endpoint in ran.stderr
        assert ran.stderr.startswith("lindy: ")
        assert ran.stderr.count("\n") == 1
    assert hashes(tmp_path) == before
    assert {path.name for path in tmp_path.iterdir()} == {"old", "empty"}


@pytest.mark.parametrize(
    "arguments",
    [
        ("dive", "--out", ""),
        ("simulate", "--out="),
        ("log", "export", "--as", "trace", "x", "--out", ""),
        ("figures", "--out", ""),
    ],
)
def test_an_empty_name_is_refused(
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
    arguments: tuple[str, ...],
):
    monkeypatch.chdir(tmp_path)
    assert main(arguments) == 1
    assert "--out: it is empty; name one" in capsys.readouterr().err
    assert not any(tmp_path.iterdir())


def test_this_folder_may_be_named(monkeypatch: pytest.MonkeyPatch, tmp_path: Path):
    monkeypatch.chdir(tmp_path)
    assert out_folder(Path()) == tmp_path
    assert not any(tmp_path.iterdir())


@pytest.mark.slow
def test_dives_without_a_name_go_into_new_folders_and_latest_is_the_newest(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
):
    monkeypatch.chdir(tmp_path)
    latest = tmp_path / "dives" / "latest"
    folders: list[Path] = []
    for _ in range(2):
        assert simulate(tmp_path) == 0
        folders.append(latest.resolve())
        assert {"dive.mcap", "report.json"} <= {path.name for path in latest.iterdir()}
    assert len({*folders}) == 2
    assert simulate(tmp_path, "--out", str(tmp_path / "elsewhere")) == 0
    assert latest.resolve() == folders[-1]
    assert simulate(tmp_path, "--out", "dives/softer") == 0
    assert latest.resolve() == tmp_path / "dives" / "softer"
    assert latest.readlink() == Path("softer")
    assert {path.name for path in (tmp_path / "dives").iterdir()} == {
        "latest", "softer", *(folder.name for folder in folders),
    }  # fmt: skip
    assert "latest" not in capsys.readouterr().out


def test_a_dive_into_latest_goes_beside_the_dive_it_points_to(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
):
    monkeypatch.chdir(tmp_path)
    fill(tmp_path / "dives" / "one", ["dive.mcap"])
    point_latest(tmp_path / "dives" / "one")
    assert out_folder(Path("dives/latest")) == tmp_path / "dives" / "one-2"


@pytest.mark.parametrize("what", ["folder", "file", "link elsewhere", "broken link elsewhere"])
def test_what_is_not_ours_and_called_latest_stays(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path, what: str
):
    monkeypatch.chdir(tmp_path)
    latest = tmp_path / "dives" / "latest"
    archive = tmp_path / "archive"
    match what:
        case "folder":
            fill(latest, ["dive.mcap"])
        case "file":
            fill(latest.parent, ["latest"])
        case _:
            latest.parent.mkdir()
            latest.symlink_to(archive)
            if what == "link elsewhere":
                fill(archive, ["dive.mcap"])
    before, is_link = hashes(tmp_path), latest.is_symlink()
    folder = tmp_path / "dives" / "new"
    folder.mkdir()
    point_latest(folder)
    said = capsys.readouterr().out
    assert said == f"{latest} is not a link to a dive; it stays as it is\n"
    assert hashes(tmp_path) == before
    assert not is_link or latest.readlink() == archive


def test_a_link_to_a_dive_that_was_removed_is_replaced(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "dives" / "new").mkdir(parents=True)
    (tmp_path / "dives" / "latest").symlink_to("removed")
    point_latest(tmp_path / "dives" / "new")
    assert (tmp_path / "dives" / "latest").readlink() == Path("new")


@pytest.mark.parametrize("service", ["recorder", "visualizer"])
def test_a_service_by_hand_does_not_write_into_another_dive(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, service: str
):
    fill(tmp_path, ("dive.mcap", "dive.rrd"))
    before = hashes(tmp_path)
    sides = ("drone",) if service == "recorder" else ("topside", "drone")
    connect = [word for r in sides for word in ("--connect", f"{r}=tcp/127.0.0.1:1")]
    assert main(["run", service, *connect, "--out", str(tmp_path)]) == 1
    assert "is there already; choose another --out" in capsys.readouterr().err
    assert hashes(tmp_path) == before


def test_a_picture_or_trace_that_is_there_is_refused(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
):
    fill(tmp_path, ("dive.png", "trace.csv", "dive.rrd"))
    before = hashes(tmp_path)
    for kind, name in (("rrd", "dive.rrd"), ("trace", "trace.csv")):
        words = ["log", "export", str(tmp_path), "--as", kind, "--out", str(tmp_path / name)]
        assert main(words) == 1
        said = capsys.readouterr().err
        assert f"cannot write {tmp_path / name}: it exists already; choose another --out" in said
    with pytest.raises(LindyError, match="it exists already"):
        write_fresh(tmp_path / "dive.png", b"new")
    assert hashes(tmp_path) == before


def test_an_empty_logs_folder_holds_no_dive(tmp_path: Path):
    assert not holds_dive(tmp_path)
    (tmp_path / "logs").mkdir()
    assert not holds_dive(tmp_path)


def test_a_tilde_is_the_home_and_letters_that_are_no_utf_8_are_refused(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setenv("HOME", str(tmp_path))
    assert named(None, [Token(value="~/dives")]) == tmp_path / "dives"
    assert named(None, [Token(value="a~")]) == Path("a~")
    assert named(None, [Token(value="~nobody-of-this-name/x")]) == Path("~nobody-of-this-name/x")
    with pytest.raises(ValueError, match="not UTF-8"):
        named(None, [Token(value="dive\udcff")])
