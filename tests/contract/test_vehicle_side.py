"""What every vehicle side promises, simulated or not (`lindy check-driver`). The rules are in
tools/driver/rules.py; a side that needs real time is run as a process.
"""

from pathlib import Path

import pytest

from tools.driver.bench import real_bench
from tools.driver.command import bench
from tools.driver.rules import REFUSES, RULES, Rule

Side = tuple[str, str]  # stack, vehicle


@pytest.mark.parametrize("rule", RULES, ids=lambda rule: rule.__name__)
def test_it_keeps_every_rule(side: Side, rule: Rule) -> None:
    with bench(*side, may_turn=True) as made:
        made.settle()
        rule(made)


@pytest.mark.slow
@pytest.mark.system
def test_a_process_stops_and_refuses_as_well(real_side: Side, tmp_path: Path) -> None:
    with real_bench(*real_side, tmp_path) as made:
        made.settle()
        for rule in REFUSES:
            rule(made)
