"""Every mistake on the command line is one sentence and status 1, before anything starts."""

import ast
import os
import re
import subprocess
import sys
from inspect import cleandoc
from pathlib import Path
from typing import Any

import msgspec
import pytest

from services.runtime.config.running import RUNNING, Running
from tests.support.cli import complaint as complaint
from tools import exit_status
from tools.__main__ import LOG, VERBS, Verb, command_line, main
from tools.live import pilots
from tools.live.stop_signals import StopSignals

GOOD = "t,surge,sway,heave,yaw\n0,0,0,0,0\n1,0,0,0.5,0\n2,0,0,0,0\n"
ROOT = Path(__file__).parents[2]
BOTH = pytest.mark.parametrize("verb", ["dive", "simulate"])


@pytest.fixture
def script(tmp_path: Path) -> str:
    path = tmp_path / "good.csv"
    path.write_text(GOOD)
    return f"script:{path}"


@BOTH
@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["--vehicle", "pionear"], "did you mean 'pioneer'?"),
        (["--link", "tehter"], "did you mean 'tether'?"),
        (["--set", "control.depht.kp=3"], "did you mean 'depth'?"),
        (
            ["--set", "control.depth.kp=-3"],
            "control.depth.kp=-3: expected a number >= 0.0 N/m or N m/rad, found -3",
        ),
        (["--set", "contrl.depth.kp=3"], "did you mean 'control'?"),
        (
            ["--set", "link.up.delay_ms=3"],
            "--set link.up.delay_ms=3: link: unknown table of a "
            "vehicle file for the stack simulated; the link is in the file of --link",
        ),
        (["--set", "vehicle.mass=11500"], "vehicle: a mass of 11500 kg and an inertia"),
        (["--set", "control.depth.kp"], "expected key.path=value"),
        (["--seconds", "-3"], "--seconds is -3, expected more than 0"),
        (["--seconds", "nan"], "--seconds is nan"),
        (["--seconds", "soon"], "'soon'"),
        (["--vehicel", "pioneer"], "Did you mean --vehicle?"),
        (["--out", "/dev/null/x"], "cannot write into --out /dev/null/x"),
        (["left", "over"], "left"),
    ],
)
def test_a_wrong_option_is_explained(
    capsys: pytest.CaptureFixture[str], verb: str, arguments: list[str], says: str, script: str
):
    assert says in complaint(capsys, verb, "--pilot", script, *arguments)


@BOTH
@pytest.mark.parametrize(
    ("pilot", "says"),
    [
        ("gampad", "did you mean 'gamepad'?"),
        ("script", "unknown pilot 'script'"),
        ("script:", "unknown pilot 'script:'"),
        ("script:fist_dive", "did you mean 'first_dive'?"),
        ("script:/nowhere/dive.csv", "there is no file /nowhere/dive.csv"),
    ],
)
def test_a_wrong_pilot_is_explained(
    capsys: pytest.CaptureFixture[str], verb: str, pilot: str, says: str
):
    assert says in complaint(capsys, verb, "--pilot", pilot)


@pytest.mark.parametrize(
    ("row", "says"),
    [
        ("1,0,0,2,0", "line 3: heave is '2', expected a number from -1 to 1"),
        ("1,0,0,deep,0", "line 3: heave is 'deep'"),
        ("1,0,0", "line 3: found 3 columns"),
        ("0,0,0,0,0", "line 3: t is 0, expected more"),
    ],
)
def test_a_malformed_script_is_named_with_its_line(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, row: str, says: str
):
    path = tmp_path / "bad.csv"
    path.write_text(f"t,surge,sway,heave,yaw\n0,0,0,0,0\n{row}\n")
    assert f"{path}: {says}" in complaint(capsys, "dive", "--pilot", f"script:{path}")


def test_a_malformed_vehicle_file_is_named_with_its_line(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, script: str
):
    path = tmp_path / "odd.toml"
    path.write_text("[vehicle]\nname = \n")
    said = complaint(capsys, "dive", "--pilot", script, "--vehicle", str(path))
    assert f"{path}: not valid TOML" in said
    assert "line 2" in said


def test_an_unknown_verb_is_met_with_the_nearest_one(capsys: pytest.CaptureFixture[str]):
    assert "unknown command 'diev'; did you mean 'dive'? known: dive, " in complaint(capsys, "diev")


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["dive", "--out="], "--out: it is empty; name one"),
        (["run", "contrl"], "did you mean 'control'?"),
        (["run", "control"], "add --connect drone="),
        (["run", "control", "--connect", "tcp/127.0.0.1:7447"], "expected SIDE=ENDPOINT"),
        (["run", "control", "--connect", "dron=tcp/127.0.0.1:7447"], "did you mean 'drone'?"),
        (["simulate", "--pilot", "gamepad"], "needs real time"),
        (["run", "control", "--connect", "drone=foo"], "'foo': expected PROTOCOL/ADDRESS"),
        (["hub", "foo"], "expected PROTOCOL/ADDRESS:PORT with tcp, tls, quic or udp, such as tcp"),
        (["hub", "udp//x"], "endpoint 'udp//x': expected PROTOCOL/ADDRESS"),
        (["hub", "tcp/127.0.0.1"], "endpoint 'tcp/127.0.0.1': expected PROTOCOL/ADDRESS:PORT"),
        (["dive", "--listen", "foo"], "--listen 'foo': expected PROTOCOL/ADDRESS"),
        (["up", "topside", "--connect", "foo"], "--connect 'foo': expected PROTOCOL/ADDRESS"),
        (["up", "drone", "--listen", "foo"], "--listen 'foo': expected PROTOCOL/ADDRESS"),
        (["up", "topside", "--listen", "tcp/127.0.0.1:1"], "--listen is for the drone"),
    ],
)
def test_other_verbs_explain_as_well(
    capsys: pytest.CaptureFixture[str], arguments: list[str], says: str
):
    assert says in complaint(capsys, *arguments)


@pytest.mark.parametrize(
    ("stack", "files"),
    [("ardusub", ()), ("mavlink", ("--no-files",)), ("cockpit", ()), ("foxglove", ("--no-files",))],
)
def test_a_stack_that_needs_real_time_is_not_simulated(
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
    stack: str,
    files: tuple[str, ...],
):
    monkeypatch.chdir(tmp_path)
    out = () if files else ("--out", str(tmp_path / "dive"))
    said = complaint(capsys, "simulate", "--stack", stack, *files, *out)
    assert f"{stack} needs real time" in said
    assert [path for path in tmp_path.rglob("*") if path.is_file()] == []


def test_a_simulated_dive_that_ctrl_c_ends_is_summed_up_and_its_status_is_130(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, script: str
):
    class Pressed(StopSignals):
        def __enter__(self) -> StopSignals:
            self.asked = True
            return super().__enter__()

    monkeypatch.setattr("tools.simulate.StopSignals", Pressed)
    assert main(["simulate", "--no-files", "--pilot", script]) == 130
    out, err = capsys.readouterr()
    assert "broke off: interrupted" in out
    assert err == "lindy: interrupted\n"


@pytest.mark.parametrize("arguments", [("--debug", "hub", "foo"), ("hub", "foo", "--debug")])
def test_debug_shows_where_an_error_came_from(
    capsys: pytest.CaptureFixture[str], arguments: tuple[str, ...]
):
    assert main(arguments) == 1
    err = capsys.readouterr().err
    assert err.startswith("Traceback")
    assert "in checked_endpoint" in err
    assert err.splitlines()[-1].startswith("lindy: endpoint 'foo'")


def test_a_mistake_of_ours_is_one_sentence_that_names_the_switch(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
):
    def mistaken(_: str) -> int:
        raise ZeroDivisionError("division by zero")

    monkeypatch.setattr("tools.run.hub", mistaken)
    assert main(["hub", "tcp/127.0.0.1:7447"]) == 1
    said = capsys.readouterr().err
    assert "(--debug shows more)" in said
    assert said.count("\n") == 1
    assert main(["--debug", "hub", "tcp/127.0.0.1:7447"]) == 1
    assert "Traceback" in capsys.readouterr().err


def test_without_rerun_a_dive_has_no_viewer_and_says_so(
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
    script: str,
):
    monkeypatch.setattr("tools.live.cockpit.find_spec", lambda _: None)  # type: ignore[misc]
    out = tmp_path / "out"
    quick = ("--set", "estimation.calibration.still_time=1", "--seconds", "1")
    assert main(["simulate", "--pilot", script, *quick, "--out", str(out)]) == 0
    assert {path.name for path in out.iterdir()} == {"dive.mcap", "report.json"}
    said = capsys.readouterr().out
    assert "rerun is not installed, so this dive has no viewer and no dive.rrd" in said
    assert "uv sync --extra viewer" in said


def test_a_mistake_leaves_no_folder_behind(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, script: str
):
    out = tmp_path / "out"
    complaint(capsys, "dive", "--pilot", script, "--link", "tehter", "--out", str(out))
    assert not out.exists()


def test_a_folder_in_which_somebody_dives_is_refused_and_left_alone(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, script: str
):
    running = Running("pioneer", {}, os.getpid(), {})
    (tmp_path / RUNNING).write_bytes(msgspec.json.encode(running))
    (tmp_path / "dive.mcap").write_text("theirs")
    said = complaint(capsys, "dive", "--pilot", script, "--out", str(tmp_path))
    assert f"a dive (process {os.getpid()}) is going on" in said
    assert (tmp_path / "dive.mcap").read_text() == "theirs"


@pytest.mark.parametrize(
    ("program", "there"),
    [("print(2)", True), ("print(0)", False), ("import no_pygame_here", False), ("1/0", False)],
)
def test_there_is_a_pad_only_when_sdl_says_so(
    monkeypatch: pytest.MonkeyPatch, program: str, there: bool
):
    monkeypatch.setattr(pilots, "QUESTION", program)
    assert pilots.pad_is_there() is there


WITH_VERBS_OF_THEIR_OWN = {"identify", "keys", "link", "topic"}
ALONE = [name for name in VERBS if name not in WITH_VERBS_OF_THEIR_OWN | {"log"}]
WORDS = [(name,) for name in ALONE] + [("log", name) for name in LOG]


def verb_of(words: tuple[str, ...]) -> Verb:
    return VERBS[words[0]] if len(words) == 1 else LOG[words[1]]


def help_of(words: tuple[str, ...]) -> str:
    command = command_line()
    for word in words:
        command = command[word]
    return cleandoc(command.help)


@pytest.mark.parametrize("words", WORDS)
def test_every_verb_has_help_with_an_example(
    capsys: pytest.CaptureFixture[str], words: tuple[str, ...]
):
    assert main([*words, "--help"]) == 0
    said = capsys.readouterr().out
    assert f"Usage: lindy {' '.join(words)} " in said
    assert f"lindy {' '.join(words)} " in said[said.index("Example: ") :]


@pytest.mark.parametrize("name", sorted(WITH_VERBS_OF_THEIR_OWN))
def test_every_verb_of_a_verb_has_help_with_an_example(
    capsys: pytest.CaptureFixture[str], name: str
):
    app = command_line()[name]
    assert app.help == VERBS[name].help
    for word in (word for word in app if not word.startswith("-")):
        assert main([name, word, "--help"]) == 0
        assert f"lindy {name} {word}" in capsys.readouterr().out.partition("Example: ")[2]


EXIT_STATUS = re.compile(r"^\| (\d+) \| (.*) \|$", re.MULTILINE)


def test_the_page_has_every_exit_status_and_names_every_verb_that_loses_data():
    page = (ROOT / "docs" / "commands.md").read_text(encoding="utf-8")
    rows = dict(EXIT_STATUS.findall(page.partition("## Exit statuses")[2]))
    every = {status for status in vars(exit_status).values() if isinstance(status, int)}
    assert {*map(int, rows)} == every
    told = {
        " ".join(words)
        for words in WORDS
        if re.search(r"xit status (1.*; )?3:", " ".join(help_of(words).split()))
    }
    assert told == {*re.findall(r"`([a-z ]+)`", rows[str(exit_status.LOST)])}


def test_the_command_line_stays_small() -> None:
    """Every verb with every option that has a name."""

    def count(app: Any) -> tuple[int, int]:
        named = [name for name in app if not name.startswith("-")]
        inner = [count(app[name]) for name in named]
        verbs, options = sum(v for v, _ in inner), sum(o for _, o in inner)
        if app.default_command is None:
            return verbs, options
        own = app.assemble_argument_collection()
        return verbs + 1, options + sum(a.name.startswith("--") for a in own if a.parse)

    verbs, options = count(command_line())
    assert verbs <= 46
    assert options <= 190


@pytest.mark.parametrize("words", WORDS)
def test_the_list_of_verbs_says_of_each_what_its_own_help_says(words: tuple[str, ...]):
    assert help_of(words).splitlines()[0] == verb_of(words).help


@pytest.mark.parametrize("words", [["--help"], ["diev"], ["log", "cot"]])
def test_help_and_a_mistyped_verb_load_no_other_verb(words: list[str]):
    code = (
        f"import sys, tools.__main__ as m; m.main({words!r});"
        "print([n for n in sys.modules if n.startswith('tools.')])"
    )
    answer = subprocess.run(
        [sys.executable, "-P", "-c", code], capture_output=True, text=True, check=True
    )
    loaded = {*ast.literal_eval(answer.stdout.splitlines()[-1])}
    assert loaded <= {"tools.__main__", "tools.exit_status", "tools.flowing_help"}


def test_one_verb_does_not_load_another():
    code = (
        "import sys, tools.__main__ as m; m.main(['ramp', '--help']);"
        "print([n for n in ('zenoh', 'pygame', 'rerun', 'mcap') if n in sys.modules])"
    )
    answer = subprocess.run(
        [sys.executable, "-P", "-c", code], capture_output=True, text=True, check=True
    )
    assert answer.stdout.splitlines()[-1] == "[]"


@pytest.mark.slow
def test_a_dive_without_files_reports_and_writes_nothing(
    capsys: pytest.CaptureFixture[str],
    tmp_path: Path,
    script: str,
    monkeypatch: pytest.MonkeyPatch,
):
    monkeypatch.chdir(tmp_path)
    before = sorted(tmp_path.iterdir())
    arguments = ["simulate", "--no-files", "--pilot", script, "--seconds", "1"]
    assert main(arguments) == 0
    said = capsys.readouterr().out
    assert "ended cleanly" in said
    assert "energy" in said
    assert sorted(tmp_path.iterdir()) == before
    assert "drop one" in complaint(capsys, *arguments, "--out", "x")


@pytest.mark.parametrize("seed", ["1.5", "1e3", "one", ""])
def test_a_seed_that_is_not_whole_is_refused(
    capsys: pytest.CaptureFixture[str], script: str, seed: str
):
    for arguments in (["simulate", "--pilot", script], ["link", "show"]):
        said = complaint(capsys, *arguments, "--seed", seed)
        assert f"--seed is {seed!r}, expected a whole number" in said


@pytest.mark.parametrize(("mapped", "there"), [(True, True), (False, False)])
def test_only_a_pad_that_sdl_has_a_mapping_for_counts(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, mapped: bool, there: bool
):
    """With a pygame that has one joystick, mapped or not."""
    folder = tmp_path / "pygame"
    folder.mkdir()
    (folder / "__init__.py").write_text(
        "class display:\n    init = staticmethod(lambda: None)\n"
        "class joystick:\n    init = staticmethod(lambda: None)\n"
        "    get_count = staticmethod(lambda: 1)\n"
    )
    (folder / "_sdl2.py").write_text(
        "class controller:\n    init = staticmethod(lambda: None)\n"
        f"    is_controller = staticmethod(lambda n: {mapped})\n"
    )
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    assert pilots.pad_is_there() is there


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("topic lst", 'lindy: Unknown command "lst". Did you mean "list"?'),
        ("dive left", "lindy: `lindy dive` takes no left. `lindy dive --help` says more"),
        ("log compare base", "lindy: `lindy log compare` needs B. `lindy log compare --help`"),
        ("simulate --out", "lindy: --out needs a value. `lindy simulate --help`"),
        ("simulate --seconds 30s", "lindy: --seconds is '30s', expected a number"),
        ("sweep --seed 1", "lindy: `lindy sweep` needs --out"),
        ("up drone --headless", "Unknown option: --headless. `lindy up --help` says more"),
        ("dive --headles", "Unknown option: --headles. Did you mean --headless? `lindy dive"),
        ("topic echo --nope=1", "Unknown option: --nope=1. `lindy topic echo --help`"),
        ("log export --nope", "Unknown option: --nope. `lindy log export --help` says more"),
        ("up --side drone", "lindy: `lindy up` takes SIDE without --side."),
        (
            "log cut dives/x --out part.mcap --dive 1",
            "lindy: --dive of `lindy log cut` is gone: --number",
        ),
        ("keys new --drone=rov1", "is gone: `lindy keys new DRONE PILOT`"),
        ("simulate --pilot first_dive", "did you mean 'script:first_dive'?"),
    ],
)
def test_a_mistyped_command_line_is_said_in_plain_words(
    capsys: pytest.CaptureFixture[str], words: str, said: str
) -> None:
    assert main(words.split()) == 1
    assert said in capsys.readouterr().err
