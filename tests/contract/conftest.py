"""Which vehicle side, law and estimator are held to their contracts. Without options: what is
shipped, and the examples.

pytest tests/contract --stack my_stack.toml --vehicle my_vehicle.toml
"""

from pathlib import Path

import pytest

EXAMPLE = Path(__file__).parents[2] / "examples" / "point_vehicle"
KNOWN = (
    ("simulated", "pioneer"),
    ("simulated", "bluerov2_heavy"),
    (f"{EXAMPLE}/stack.toml", f"{EXAMPLE}/vehicle.toml"),
)
OWN = Path(__file__).parents[2] / "examples" / "library"
CHAINS = (
    ("simulated", "pioneer"),
    (f"{OWN}/own_law_stack.toml", "pioneer"),
    (f"{OWN}/own_estimator_stack.toml", "pioneer"),
)
REAL = KNOWN[-1]  # the one that is also run as a process


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--stack", help="a name in deploy/stacks, or the path of a TOML file")
    parser.addoption("--vehicle", default="pioneer", help="a name, or the path of a TOML file")


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    for fixture, sides in (("side", KNOWN), ("real_side", (REAL,)), ("chain", CHAINS)):
        if fixture in metafunc.fixturenames:
            # Options are not there when pytest is told of this folder only by its settings.
            stack: str | None = metafunc.config.getoption("--stack", None)
            if stack is not None:
                sides = ((stack, str(metafunc.config.getoption("--vehicle"))),)
            names = [f"{Path(s).parent.name or s}-{Path(s).stem}-{Path(v).stem}" for s, v in sides]
            slow = stack is None and fixture == "chain"
            marks = [pytest.mark.slow] if slow else []
            metafunc.parametrize(
                fixture, [pytest.param(each, marks=marks) for each in sides], ids=names
            )
