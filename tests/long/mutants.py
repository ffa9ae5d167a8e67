"""Do the tests notice a fault in a law? Run it for minutes: `make mutants`.

Puts one small fault after the other into a copy of the code (a comparison the other way round, a
sign, a constant times 1.5, two arguments exchanged, a statement left out), runs the tests of that
law on it, and prints the share of faults that made a test fail, and those that did not. The faults
are drawn with a fixed seed, so two runs of the same code try the same ones.

`python tests/long/mutants.py [--each N] [--seed S] [LAW ...]` with another number of faults in each
law, with others, or for these laws only, by the names of their files without `.py`. `--today`: for
the law whose turn it is, with faults that were not drawn on its last turn.
"""

import argparse
import ast
import compileall
import os
import shlex
import shutil
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from datetime import date
from pathlib import Path
from queue import SimpleQueue
from random import Random
from typing import Literal, cast

EACH = 15  # faults in each law
GOAL = 0.9  # of the faults are to be noticed
WORKERS = 2
PATIENCE = 4.0  # times as long as without a fault, and LEAST_PATIENCE; then it counts as noticed
LEAST_PATIENCE = 15.0
MEMORY = 8_000_000  # [KiB] address space; a fault may make a list that never ends
PARTS = (
    "messages", "services", "tools", "lindy", "tests", "research", "deploy", "pyproject.toml",
)  # fmt: skip

# law → its tests
REFERENCE, CONTROL = "tests/services/reference", "tests/services/control"
LAWS: dict[str, tuple[str, ...]] = {
    "services/reference/trajectory/minimum_jerk.py": (
        f"{REFERENCE}/trajectory/test_minimum_jerk.py", f"{REFERENCE}/trajectory/test_position.py",
        "research/tests/laws/test_stepping.py",
    ),
    "services/reference/trajectory/vector.py": (f"{REFERENCE}/trajectory/test_vector.py",),
    "services/reference/guidance/path_following.py": (
        f"{REFERENCE}/guidance/test_time_scaling.py",
    ),
    "services/reference/guidance/guards.py": (
        f"{REFERENCE}/guidance/test_guards.py",
    ),
    "services/reference/failsafe/machine.py": (f"{REFERENCE}/failsafe",),
    "services/reference/failsafe/table.py": (f"{REFERENCE}/failsafe",),
    "services/control/axis/axis.py": (f"{CONTROL}/axis", f"{CONTROL}/test_stability.py"),
    "services/control/axis/plant.py": (f"{CONTROL}/axis",),
    "services/control/allocation.py": (f"{CONTROL}/allocation",),
    "services/estimation/filter.py": ("tests/services/estimation",),
    "services/estimation/hull.py": ("tests/services/estimation",),
    "services/estimation/quantity.py": ("tests/services/estimation",),
    "services/tether/link_model.py": ("tests/services/tether",),
    "services/tether/profile.py": ("tests/services/tether",),
    "services/runtime/node/gate.py": (
        "tests/services/runtime/node/test_gate.py",
        "tests/services/runtime/node/test_clock_offset.py",
    ),
    "services/vehicle/actuator_gate.py": ("tests/services/vehicle",),
    "services/simulator/vessel.py": (
        "tests/services/simulator/test_sim_vessel.py",
        "tests/services/simulator/test_sim_surroundings.py",
    ),
}  # fmt: skip
# (law, how the fault begins) → why nobody could notice
EQUIVALENT: dict[tuple[str, str], str] = {
    (
        "services/reference/trajectory/minimum_jerk.py",
        "solve: e * sign  →  e / sign",
    ): "the sign is ±1",
    (
        "services/reference/trajectory/minimum_jerk.py",
        "pair: min(candidates",
    ): "one range at most holds a peak, because the distances at their ends rise",
    ("services/reference/trajectory/minimum_jerk.py", ": 80  →  81"): (
        "80 halvings reach the last bit"
    ),
    ("services/reference/trajectory/minimum_jerk.py", "_peaks: (low, high)  →  (high, low)"): (
        "a bisection has no direction"
    ),
    (
        "services/control/allocation.py",
        "Allocation._at_once: (ax, by",
    ): "a sum has no order",
    ("services/control/allocation.py", "Allocation._at_once: yields.append"): (
        "one after the other comes to the same as all at once"
    ),
    (
        "services/tether/profile.py",
        "Delays.next_ms: np.minimum(drawn",
    ): "a minimum of two has no order",
    (
        "services/tether/profile.py",
        "Delays.next_ms: np.clip(self._random",
    ): "both are a maximum of two",
}

COMPARED: dict[type[ast.cmpop], type[ast.cmpop]] = {
    ast.Lt: ast.GtE, ast.LtE: ast.Gt, ast.Gt: ast.LtE, ast.GtE: ast.Lt, ast.Eq: ast.NotEq,
    ast.NotEq: ast.Eq, ast.Is: ast.IsNot, ast.IsNot: ast.Is, ast.In: ast.NotIn, ast.NotIn: ast.In,
}  # fmt: skip
COUNTED: dict[type[ast.operator], type[ast.operator]] = {
    ast.Add: ast.Sub, ast.Sub: ast.Add, ast.Mult: ast.Div, ast.Div: ast.Mult,
}  # fmt: skip
TYPES = {"annotation", "returns", "decorator_list", "bases"}  # fields of nodes
EXTREME = {"min": "max", "max": "min"}
SYMMETRIC = {"hypot", "min", "max", "add", "_plus", "_dot"}


Outcome = Literal["passed", "failed", "no end"]


@dataclass(frozen=True)
class Fault:
    law: str
    what: str  # where, and what is written there instead of what
    source: str  # of the whole file

    @property
    def could_be_noticed(self) -> bool:
        return not any(
            law == self.law and self.what.startswith(beginning) for law, beginning in EQUIVALENT
        )


def faults(law: str, count: int, seed: int) -> list[Fault]:
    """`count` of all the faults that could be made, less those that nobody could notice."""
    every = list(_every(law, Path(law).read_text(encoding="utf-8")))
    drawn = Random(f"{seed} {Path(law).stem}").sample(every, min(count, len(every)))
    return [fault for fault in drawn if fault.could_be_noticed]


def _every(law: str, text: str) -> Iterator[Fault]:
    tree = ast.parse(text)
    for place, parent, field, index, node in _places(tree):
        for other in _instead(node):
            if ast.dump(other) == ast.dump(node):
                continue
            _put(parent, field, index, other)
            line = f"{place}: {_short(node)}  →  {_short(other)}"
            yield Fault(law, line, ast.unparse(ast.fix_missing_locations(tree)))
            _put(parent, field, index, node)


Place = tuple[str, ast.AST, str, int | None, ast.AST]


def _places(parent: ast.AST, place: str = "") -> Iterator[Place]:
    """Every node that runs, with where it stands: not annotations and defaults of settings."""
    if isinstance(parent, ast.ClassDef | ast.FunctionDef):
        place = f"{place}.{parent.name}".strip(".")
    for field, value in ast.iter_fields(parent):
        if field in TYPES or (field == "keywords" and isinstance(parent, ast.ClassDef)):
            continue
        several = cast("list[object]", value if isinstance(value, list) else [value])
        for k, node in enumerate(several):
            if not isinstance(node, ast.AST) or _is_said_only(parent, node, place):
                continue
            yield place, parent, field, k if isinstance(value, list) else None, node
            yield from _places(node, place)


def _is_said_only(parent: ast.AST, node: ast.AST, place: str) -> bool:
    """Of types, fields, the beginning of an object, or the words of an error: not what is done."""
    if isinstance(node, ast.Raise | ast.ExceptHandler):
        return True
    if isinstance(node, ast.keyword) and node.arg == "strict":
        return True
    if isinstance(node, ast.Assign) and place.endswith("__init__"):
        return isinstance(node.value, ast.Name | ast.Attribute)
    if isinstance(parent, ast.ClassDef) and isinstance(node, ast.AnnAssign | ast.Assign):
        return True
    return isinstance(node, ast.Subscript) and ast.unparse(node.value) in {
        "Annotated", "Callable", "dict", "list", "set", "tuple", "frozenset",
    }  # fmt: skip


def _put(parent: ast.AST, field: str, index: int | None, node: ast.AST) -> None:
    if index is None:
        setattr(parent, field, node)
    else:
        getattr(parent, field)[index] = node


def _short(node: ast.AST) -> str:
    return " ".join(ast.unparse(node).split())


def _instead(node: ast.AST) -> Iterator[ast.AST]:  # noqa: C901 - one line for each kind of fault
    match node:
        case ast.Compare(left, ops, right):
            for k, op in enumerate(ops):
                yield ast.Compare(left, [*ops[:k], COMPARED[type(op)](), *ops[k + 1 :]], right)
        case ast.BinOp(left, op, right) if type(op) in COUNTED:
            yield ast.BinOp(left, COUNTED[type(op)](), right)
        case ast.AugAssign(target, op, value) if type(op) in COUNTED:
            yield ast.AugAssign(target, COUNTED[type(op)](), value)
        case ast.UnaryOp(ast.USub() | ast.Not(), operand):
            yield operand
        case ast.BoolOp(op, values):
            yield ast.BoolOp(ast.Or() if isinstance(op, ast.And) else ast.And(), values)
        case ast.IfExp(test, body, orelse):
            yield ast.IfExp(test, orelse, body)
        case ast.Call(ast.Name(name), args, keywords) if name in EXTREME:
            yield ast.Call(ast.Name(EXTREME[name]), args, keywords)
        case ast.Call(func, [one, other, *rest], keywords):
            if ast.unparse(func) not in SYMMETRIC:
                yield ast.Call(func, [other, one, *rest], keywords)
        case ast.Tuple([one, other, *rest], context):
            yield ast.Tuple([other, one, *rest], context)
        case ast.Constant(bool(value)):
            yield ast.Constant(not value)
        case ast.Constant(int(value)):
            yield ast.Constant(value + 1)
        case ast.Constant(float(value)):
            yield ast.Constant(1.5 * value if value else 1.0)
        case ast.Expr(ast.Call()) | ast.Assign([ast.Attribute()]):
            yield ast.Pass()
        case _:
            pass


class Copy:
    """The code in a folder of its own, where faults may be put in."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        for part in PARTS:
            ignored = shutil.ignore_patterns("__pycache__", "node_modules")
            if Path(part).is_dir():
                shutil.copytree(part, folder / part, ignore=ignored)
            else:
                shutil.copy2(part, folder / part)
        compileall.compile_dir(folder / "services", quiet=1)

    def outcome(
        self, tests: Sequence[str], marks: str = "not system", patience: float | None = None
    ) -> Outcome:
        """Of these tests; they may take this long [s]."""
        # As a module, so that the folder it runs in comes before the installed code.
        run = f'ulimit -v {MEMORY}; exec "{sys.executable}" -m pytest -x -n 0 -q '
        run += f'{shlex.join(tests)} -p no:cacheprovider -m "{marks}" --hypothesis-profile verdict'
        # What was compiled without a fault is used, nothing is added.
        environment = os.environ | {"PYTHONHASHSEED": "0", "PYTHONDONTWRITEBYTECODE": "1"}
        try:
            done = subprocess.run(
                ["sh", "-c", run], cwd=self.folder, env=environment, timeout=patience,
                capture_output=True, check=False,
            )  # fmt: skip
        except subprocess.TimeoutExpired:
            return "no end"
        return "failed" if done.returncode else "passed"

    def outcome_with(
        self,
        file: str,
        fault: str,
        tests: Sequence[str],
        marks: str = "not system",
        patience: float | None = None,
    ) -> Outcome:
        """… with another text in a file."""
        path = self.folder / file
        path.write_text(fault, encoding="utf-8")
        try:
            return self.outcome(tests, marks, patience)
        finally:
            shutil.copy2(file, path)


def main(tried: dict[str, list[Fault]]) -> int:
    found: dict[str, Counter[Outcome]] = {}
    with tempfile.TemporaryDirectory() as root, ThreadPoolExecutor(WORKERS) as pool:
        copies = SimpleQueue[Copy]()
        for k in range(WORKERS):
            copies.put(Copy(Path(root) / str(k)))
        for law in tried:
            found[law] = _outcomes(law, tried[law], pool, copies)
            print(f"{_noticed(found[law])} in {law}", flush=True)
    total = sum(found.values(), Counter[Outcome]())
    share = 1.0 - total["passed"] / total.total()
    print(f"{_noticed(total)}: {share:.1%}. The goal is {GOAL:.0%}.")
    return int(share < GOAL)


def _outcomes(
    law: str, tried: list[Fault], pool: ThreadPoolExecutor, copies: SimpleQueue[Copy]
) -> Counter[Outcome]:
    """How the tests of a law ended with one fault after the other. Prints those not noticed."""

    def ended(fault: Fault) -> Outcome:
        copy = copies.get()
        try:
            return copy.outcome_with(law, fault.source, LAWS[law], patience=patience)
        finally:
            copies.put(copy)

    copy, began = copies.get(), time.monotonic()
    if copy.outcome(LAWS[law]) != "passed":
        raise SystemExit(f"the tests of {law} fail without a fault: {' '.join(LAWS[law])}")
    copies.put(copy)
    patience = max(LEAST_PATIENCE, PATIENCE * (time.monotonic() - began))
    outcomes = Counter[Outcome]()
    for fault, outcome in zip(tried, pool.map(ended, tried), strict=True):
        outcomes[outcome] += 1
        if outcome == "passed":
            print(f"    not noticed: {fault.what}", flush=True)
    return outcomes


def _noticed(outcomes: Counter[Outcome]) -> str:
    endless = f" ({outcomes['no end']} by a test that came to no end)" if outcomes["no end"] else ""
    return f"{outcomes['failed'] + outcomes['no end']} of {outcomes.total()} noticed{endless}"


def _chosen(names: list[str]) -> list[str]:
    by_name = {Path(law).stem: law for law in LAWS}
    if unknown := sorted(set(names) - set(by_name)):
        raise SystemExit(f"no law is called {unknown[0]!r}; there are {', '.join(by_name)}")
    return [by_name[name] for name in names] or list(LAWS)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("laws", nargs="*", metavar="LAW")
    parser.add_argument("--each", type=int, default=EACH, metavar="N")
    parser.add_argument("--seed", type=int, default=1, metavar="S")
    parser.add_argument("--today", action="store_true")
    said = parser.parse_args()
    chosen, seed = _chosen(said.laws), said.seed
    if said.today:
        seed, turn = divmod(date.today().toordinal(), len(chosen))
        chosen = chosen[turn : turn + 1]
    sys.exit(main({law: faults(law, said.each, seed) for law in chosen}))
