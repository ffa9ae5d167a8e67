"""What `pip install` of the wheel brings: one name, beside whatever the user has."""

import ast
import json
import socket
import subprocess
import sys
import tarfile
import zipfile
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from types import ModuleType

import pytest

from lindy import api
from tests.support.patience import PATIENCE_S
from tests.wheel.conftest import ROOT, Installed

pytestmark = [pytest.mark.slow, pytest.mark.system]

OURS = ("messages", "services", "tools")
QUICK = "--set estimation.calibration.still_time=1"
API = sorted(path.stem for path in Path(api.__file__).parent.glob("[a-z]*.py"))


def build_hook() -> ModuleType:
    spec = spec_from_file_location("hatch_build", ROOT / "hatch_build.py")
    assert spec is not None
    assert spec.loader is not None
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def tracked() -> list[str]:
    """Files of the repository that belong into the wheel."""
    folders = ("lindy", *OURS, "deploy")
    listed = subprocess.run(
        ["git", "ls-files", "--", *folders], cwd=ROOT, capture_output=True, text=True, check=True
    )
    return listed.stdout.splitlines()


def test_one_name_is_installed(installed: Installed) -> None:
    found = {path.name for path in installed.packages.iterdir()} - {"libraries.pth"}
    (version,) = [name for name in found if name.endswith(".dist-info")]
    assert found == {"lindy", version}


def test_every_file_of_the_repository_is_in_it_and_no_other(installed: Installed) -> None:
    with zipfile.ZipFile(installed.wheel) as wheel:
        inside = {name for name in wheel.namelist() if ".dist-info/" not in name}
    assert inside == {f if f.startswith("lindy/") else f"lindy/{f}" for f in tracked()}


def test_nothing_but_imports_is_changed(installed: Installed) -> None:
    """And every import of ours: what is left, read as a program, is the same."""

    class Back(ast.NodeTransformer):
        def visit_ImportFrom(self, node: ast.ImportFrom) -> ast.stmt:
            root, _, rest = (node.module or "").partition(".")
            assert root not in OURS, ast.unparse(node)
            if root == "lindy" and rest.partition(".")[0] in OURS:
                node.module = rest
            elif root == "lindy" and not rest and node.names[0].name in OURS:
                return ast.Import(node.names)
            return node

    with zipfile.ZipFile(installed.wheel) as wheel:
        for file in tracked():
            place = file if file.startswith("lindy/") else f"lindy/{file}"
            source = (ROOT / file).read_bytes()
            if file.endswith(".py"):
                built = Back().visit(ast.parse(wheel.read(place)))
                assert ast.dump(built) == ast.dump(ast.parse(source)), file
            else:
                assert wheel.read(place) == source, file


def test_the_source_distribution_builds_the_same_wheel(
    installed: Installed, tmp_path: Path
) -> None:
    build = [sys.executable, "-P", "-m", "hatchling", "build"]
    subprocess.run([*build, "-t", "sdist", "-d", str(tmp_path)], cwd=ROOT, check=True)
    (archive,) = tmp_path.glob("*.tar.gz")
    with tarfile.open(archive) as sources:
        sources.extractall(tmp_path, filter="data")
    folder = tmp_path / archive.name.removesuffix(".tar.gz")
    subprocess.run([*build, "-t", "wheel", "-d", str(tmp_path)], cwd=folder, check=True)
    (wheel,) = tmp_path.glob("*.whl")
    with zipfile.ZipFile(wheel) as ours, zipfile.ZipFile(installed.wheel) as theirs:
        assert ours.namelist() == theirs.namelist()
        assert all(ours.read(name) == theirs.read(name) for name in ours.namelist())


@pytest.mark.parametrize("module", API)
def test_each_module_of_the_api_loads_beside_the_users_own(
    installed: Installed, module: str
) -> None:
    name = "lindy.api" if module == "__init__" else f"lindy.api.{module}"
    code = (
        f"import sys, {name} as it; assert all(hasattr(it, n) for n in it.__all__); "
        f"print({{n.partition('.')[0] for n in sys.modules}} & {set(OURS)})"
    )
    status, said, wrong = installed.run([str(installed.programs / "python"), "-c", code])
    assert (status, said, wrong) == (0, "set()\n", "")


def test_a_dive_of_real_processes_is_flown(installed: Installed) -> None:
    status, said, wrong = installed.run(
        f"lindy dive --headless --seconds 3 {QUICK} --out dives/wheel"
    )
    assert status == 0, said + wrong
    report = json.loads((installed.desk / "dives/wheel/report.json").read_text())
    assert report["exit"] == "clean"
    assert {"control", "reference", "estimation", "simulator"} <= report["services"].keys()


@pytest.mark.parametrize(
    ("words", "module"),
    [
        ("examples/library/own_law_stack.toml", "reference"),
        (
            "examples/point_vehicle/stack.toml --vehicle examples/point_vehicle/vehicle.toml",
            "driver",
        ),
    ],
)
def test_a_service_of_the_users_flies(installed: Installed, words: str, module: str) -> None:
    out = f"dives/{module}"
    status, said, wrong = installed.run(
        f"lindy simulate --stack {words} {QUICK} --seconds 3 --out {out}"
    )
    assert status == 0, said + wrong
    report = json.loads((installed.desk / out / "report.json").read_text())
    assert module in report["services"]
    assert report["exit"] == "clean"


def test_the_programs_of_the_library_page_run(installed: Installed) -> None:
    python = str(installed.programs / "python")
    for program in sorted((installed.desk / "examples" / "library").glob("*.py")):
        if '__name__ == "__main__"' in program.read_text():
            status, said, wrong = installed.run([python, str(program)])
            assert status == 0, f"{program}: {said}{wrong}"
            assert said


def test_the_drones_side_and_the_topside_find_each_other(installed: Installed) -> None:
    """`lindy up` starts children and hands over to smaller programs, by the names of modules."""
    command = installed.programs / "lindy"
    up = [str(command), "up"]
    with socket.create_server(("127.0.0.1", 0)) as free:
        link = f"tcp/127.0.0.1:{free.getsockname()[1]}"
    common = ["--insecure", "--name", "wheel", "--set", "estimation.calibration.still_time=1"]
    with subprocess.Popen(
        [*up, "drone", "--listen", link, "--out", "dives/drone", *common],
        cwd=installed.desk, env=installed.environment, stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT, text=True,
    ) as drone:  # fmt: skip
        try:
            status, said, wrong = installed.run(
                [*up, "topside", "--connect", link, "--out", "dives/topside",
                 "--pilot", "script:first_dive", "--seconds", "3", *common]
            )  # fmt: skip
        finally:
            drone.terminate()
        heard, _ = drone.communicate(timeout=PATIENCE_S)
    assert status == 0, said + wrong + heard
    assert drone.returncode == 0, heard
    processes = json.loads((installed.desk / "dives/drone/report.json").read_text())["services"]
    assert {"control", "reference", "estimation"} <= processes.keys()


# The build hook.


@pytest.mark.parametrize(
    ("said", "moved"),
    [
        ("from services.a import b", "from lindy.services.a import b"),
        ("import messages.units as u, os", "import lindy.messages.units as u, os"),
        (
            "if a: from tools import b; import tools",
            "if a: from lindy.tools import b; from lindy import tools",
        ),
        ("x = 'é'; from tools import b", "x = 'é'; from lindy.tools import b"),
        ("from . import services", "from . import services"),
        ("yes = 'from services import a'", "yes = 'from services import a'"),
    ],
)
def test_an_import_is_moved(said: str, moved: str) -> None:
    assert build_hook().moved_imports(said.encode()).decode() == moved


def test_an_import_that_would_bind_another_name_is_refused() -> None:
    for line in ("import services.runtime", "import os, tools"):
        with pytest.raises(ValueError, match="line 1: say `from"):
            build_hook().moved_imports(line.encode())
