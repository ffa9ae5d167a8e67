"""Every command of the README, with the installed wheel, in a folder with the files it names."""

import json
import os
import re
import shutil
import signal
import subprocess
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import pytest

from tests.support.doors import free_port
from tests.support.once import once
from tests.support.patience import PATIENCE_S, until
from tests.wheel.conftest import ROOT, Installed

pytestmark = [pytest.mark.slow, pytest.mark.system]

BLOCKS = re.findall(
    r"^```\w*\n(.*?)^```", (ROOT / "README.md").read_text(), re.DOTALL | re.MULTILINE
)
COMMANDS = [
    line.removeprefix("$ ").strip()
    for block in BLOCKS
    for line in block.splitlines()
    if re.match(r"(\$ )?(.*\| )?lindy ", line)
]
# Asked of a dive that goes on; these are asked one after the other, of one dive.
LIVE = re.compile(r"lindy (ask|fault|link (set|down|up|profile)) ")
QUICK = "--set estimation.calibration.still_time=1"


def without(option: str) -> Callable[[str], str]:
    return lambda line: re.sub(rf" {option} \S+", "", line)


def helped(line: str) -> str:
    """Its options alone: the part of the line up to the first option or comment, and --help."""
    return f"{re.split(' --| +#', line)[0]} --help"


# What a verb needs to be short, or why no more than its help can be asked for.
WAYS: list[tuple[str, Callable[[str], str]]] = [
    # It waits for a person, and ends as by Ctrl+C.
    (
        r"lindy dive .*--cockpit",
        lambda line: (
            f"timeout --preserve-status --signal=INT 40 {line} --headless {QUICK} --set "
            f"cockpit.port={free_port()}"  # another such command may be tried at the same time
        ),
    ),
    (r"lindy simulate .*--from", lambda line: line),
    (
        r"lindy simulate",
        lambda line: f"{without('--seconds')(line)} --seconds 2 {QUICK} --no-files",
    ),
    (r"lindy dive", lambda line: f"{without('--seconds')(line)} --headless --seconds 2 {QUICK}"),
    (r"lindy sweep", lambda line: f"{re.sub(r'--seed [^ ]+', '--seed 1..2', line)} --seconds 2"),
    (r"lindy replay(?!.*--through)", lambda line: f"{line} --to 31 --headless"),
    (r"lindy (up|fly|drones) ", helped),  # another machine
    (r"lindy (doctor|calibrate|pad|cockpit) ", helped),  # a board, a pad, a person
    (r"lindy import ", helped),  # a log of somebody's vehicle
    (r"lindy (run|hub) ", helped),  # they never end
]


def shortened(line: str) -> str:
    line = re.sub(r"\s+#.*", "", line)
    return next((way(line) for verb, way in WAYS if re.search(verb, line)), line)


@pytest.fixture(scope="session")
def desk(
    installed: Installed, tmp_path_factory: pytest.TempPathFactory, worker_id: str
) -> Installed:
    """With a dive that was flown, and the files that the README speaks of as the user's own."""

    def lay(folder: Path) -> None:
        at = folder / "desk"
        shutil.copytree(installed.desk, at, symlinks=True)
        shutil.copytree(ROOT / "deploy", at / "deploy")
        shutil.copy(at / "deploy/dives/first_dive.csv", at / "my.csv")
        shutil.copy(at / "deploy/stacks/simulated.toml", at / "my_stack.toml")
        shutil.copy(at / "deploy/vehicles/pioneer.toml", at / "mine.toml")
        shutil.copy(at / "deploy/links/remote.toml", at / "my_link.toml")
        status, said, wrong = replace(installed, desk=at).run(f"lindy simulate {QUICK}")
        assert status == 0, said + wrong
        flown = (at / "dives/latest").resolve()
        for name in ("one", "other", "at_rest"):
            shutil.copytree(flown, at / "dives" / name, copy_function=os.link)
        whole = (flown / "dive.mcap").read_bytes()
        (at / "broken.mcap").write_bytes(whole[: len(whole) * 2 // 3])

    return replace(installed, desk=once(tmp_path_factory, worker_id, "desk", lay) / "desk")


@pytest.fixture
def own_desk(desk: Installed, tmp_path: Path) -> Installed:
    """A copy for one test: many verbs write into it."""
    shutil.copytree(desk.desk, tmp_path / "desk", symlinks=True, copy_function=os.link)
    return replace(desk, desk=tmp_path / "desk")


def test_there_are_commands() -> None:
    assert len(COMMANDS) > 5


@pytest.mark.parametrize("line", [line for line in COMMANDS if not LIVE.match(line)])
def test_a_command_does_what_it_should(own_desk: Installed, line: str) -> None:
    status, said, wrong = own_desk.run(shortened(line))
    if re.search(r"lindy (figures|bench)", line):
        assert status == 1
        assert "is in the package lindy-research, which is not installed" in wrong
    elif "--pilot keyboard" in line and "DISPLAY" not in own_desk.environment:
        assert status == 1
        assert "--pilot keyboard needs a window" in wrong
    elif "--cockpit" in line:
        assert re.search(r"https?://\S+", said), said + wrong
    else:
        assert status == 0, said + wrong
        assert said or wrong or "--out" in line


def test_a_running_dive_answers(own_desk: Installed) -> None:
    lines = [shortened(line) for line in COMMANDS if LIVE.match(line)]
    if not lines:
        pytest.skip("the README asks nothing of a running dive")
    file = own_desk.desk / "said.txt"
    with file.open("w") as said:
        dive = subprocess.Popen(
            ["bash", "-c", f"exec lindy dive --headless --seconds 3000 {QUICK}"],
            cwd=own_desk.desk, env=own_desk.environment, stdin=subprocess.DEVNULL,
            stdout=said, stderr=said,
        )  # fmt: skip
    try:

        def require_running() -> None:
            assert dive.poll() is None, file.read_text()

        until(
            lambda: own_desk.run("lindy ask mode manual")[0] == 0, file.read_text, require_running
        )
        for line in lines:
            asks = line.startswith("lindy ask")
            status, answer, wrong = own_desk.run(f"{line} --json" if asks else line)
            if asks:  # a drone may refuse
                assert "accepted" in json.loads(answer or "{}"), f"{line}: {answer}{wrong}"
            else:
                assert status == 0, f"{line}: {answer}{wrong}"
    finally:
        with suppress(ProcessLookupError):
            dive.send_signal(signal.SIGINT)
        dive.wait(PATIENCE_S)
