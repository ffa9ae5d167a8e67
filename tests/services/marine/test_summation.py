"""Sums that fly have the same bits under every Python."""

import ast
from pathlib import Path

from hypothesis import given
from hypothesis import strategies as st

import messages
import services
from services.marine.summation import plain_sum

# Where the builtin `sum` counts whole numbers, which are exact.
COUNTING = {
    "messages/events.py",
    "services/link_monitor/core.py",
    "services/recorder/io/mcap_file.py",
    "services/runtime/hosts/registry.py",
    "services/runtime/launch/child.py",
    "services/runtime/node/node.py",
    "services/tether/link_model.py",
    "services/visualizer/curves.py",
    "services/visualizer/status.py",
    "services/visualizer/computed.py",
}
ROOT = Path(services.__path__[0]).parent


@given(st.lists(st.floats(-1e9, 1e9), max_size=50))
def test_it_rounds_after_each_addition(values: list[float]):
    total = 0.0
    for value in values:
        total += value
    assert plain_sum(values) == total


def test_no_service_adds_floats_with_the_builtin_sum():
    for package in (services, messages):
        for path in Path(package.__path__[0]).rglob("*.py"):
            text = path.read_text(encoding="utf-8")
            lines = [
                node.lineno
                for node in ast.walk(ast.parse(text if "sum" in text else ""))
                if isinstance(node, ast.Name) and node.id in ("sum", "fsum", "sumprod")
            ]
            name = path.relative_to(ROOT).as_posix()
            assert name in COUNTING or not lines, (
                f"{name}:{lines}: use plain_sum, or count in whole numbers"
            )
