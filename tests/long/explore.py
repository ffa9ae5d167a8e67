"""Search for cases that break a law, for minutes.

A plugin for pytest. Each property test runs on fresh random cases, FACTOR times as many as it draws
in `make test`; at the end stands, for each one that failed, the line to paste above its `@given`,
so that the case is tried in every run from then on. The exit status is pytest's: 1 with a find.
"""

import ast
import re
from collections.abc import Generator, Iterator
from typing import cast

import pytest
from hypothesis import HealthCheck, is_hypothesis_test, settings

FACTOR = 20
FOUND = "found case"  # the name of what a worker sends home with its report
SETTINGS = "_hypothesis_internal_use_settings"  # where hypothesis keeps those of a test

settings.register_profile(
    "explore",
    derandomize=False,
    database=None,
    deadline=None,
    suppress_health_check=[HealthCheck.too_slow],
    print_blob=True,
)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    tests: set[object] = {item.function for item in items if isinstance(item, pytest.Function)}
    for test in filter(is_hypothesis_test, tests):  # each once, with however many parameters
        own: settings | None = getattr(test, SETTINGS, None)
        if own is None:  # of a state machine
            continue
        setattr(test, SETTINGS, settings(own, max_examples=FACTOR * own.max_examples))


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(
    item: pytest.Item, call: pytest.CallInfo[None]
) -> Generator[None, pytest.TestReport, pytest.TestReport]:
    report = yield
    if call.excinfo is not None and report.failed and isinstance(item, pytest.Function):
        fixtures = {*item.funcargs, "self"}
        for error in single(call.excinfo.value):
            notes = "\n".join(getattr(error, "__notes__", ()))
            line = case_line(notes, item.originalname, fixtures) or f"# {error!r:.200}"
            report.user_properties.append((FOUND, line))
    return report


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    failed: list[pytest.TestReport] = terminalreporter.getreports("failed")
    if failed:
        terminalreporter.section("cases to keep: paste each line above the test's @given")
    for report in failed:
        terminalreporter.write_line(report.nodeid)
        for name, line in report.user_properties:
            if name == FOUND:
                terminalreporter.write_line(f"    {line}")


def single(error: BaseException) -> Iterator[BaseException]:
    """The errors in a group of errors; hypothesis groups what it found in one test."""
    if isinstance(error, BaseExceptionGroup):
        for one in cast("tuple[BaseException, ...]", error.exceptions):
            yield from single(one)
    else:
        yield error


def case_line(notes: str, test: str, fixtures: set[str]) -> str | None:
    """The decorator that brings the case back, from what hypothesis notes about it. None: it says
    nothing that does.

    Args:
        fixtures: names of the arguments that pytest gives and not hypothesis.
    """
    again = re.search(r"@reproduce_failure\(.*\)", notes)
    call = re.search(rf"\b{test}\(\n(.*?)^\)", notes, re.DOTALL | re.MULTILINE)
    if call is None:
        return again and again[0]
    named = re.split(r"^    (\w+)=", call[1], flags=re.MULTILINE)[1:]
    values = dict(zip(named[::2], named[1::2], strict=True))
    try:
        given = [said(name, text) for name, text in values.items() if name not in fixtures]
    except SyntaxError:  # an object that does not print as what makes it, or data()
        return again and again[0]
    return f"@example({', '.join(given)})"


def said(name: str, text: str) -> str:
    """name=value on one line, without comments.

    Raises:
        SyntaxError: the value is no expression.
    """
    if text.startswith("data(...)"):
        raise SyntaxError(text)
    tree = ast.parse(f"dict({name}={text}\n)", mode="eval")
    return ast.unparse(tree).removeprefix("dict(").removesuffix(")")
