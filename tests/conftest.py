"""Every run of the tests is the same run, on any machine: the property tests draw the same cases.

New cases are searched for by tests/long/explore.py alone. A case found there is
kept as an `@example` of its test.
"""

import pytest
from hypothesis import HealthCheck, Phase, is_hypothesis_test, settings
from hypothesis.internal.constants_ast import Constants

settings.register_profile(
    "same",
    max_examples=60,  # tests/long/explore.py draws more, and others
    derandomize=True,  # cases follow from the text of the test alone
    database=None,  # nor from what failed here before
    deadline=None,  # nor does the verdict follow from the speed of the machine
    suppress_health_check=[HealthCheck.too_slow],
    print_blob=True,
)
# The same cases, and no time spent on making one that fails small: tests/long/mutants.py.
settings.register_profile(
    "verdict", settings.get_profile("same"), phases=[Phase.explicit, Phase.generate]
)
settings.register_profile("whole", settings.get_profile("same"))  # `make slow`
settings.load_profile("same")

PART, LEAST = 6, 5  # `make test` draws a sixth of each test's cases, `make slow` all of them
SETTINGS = "_hypothesis_internal_use_settings"  # where hypothesis keeps those of a test


@pytest.hookimpl(trylast=True)  # after `--hypothesis-profile` was obeyed
def pytest_configure() -> None:
    """Hypothesis also draws constants that it finds in the modules imported so far, which depends
    on who ran before in the same process, and on the constants. Not in the runs that are equal."""
    if settings().derandomize:
        pytest.MonkeyPatch().setattr(
            "hypothesis.internal.conjecture.providers._get_local_constants", Constants
        )


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    if settings.get_current_profile_name() != "same":
        return
    tests: set[object] = {item.function for item in items if isinstance(item, pytest.Function)}
    for test in filter(is_hypothesis_test, tests):  # each once, with however many parameters
        own: settings | None = getattr(test, SETTINGS, None)
        if own is None:  # of a state machine
            continue
        fewer = max(min(LEAST, own.max_examples), own.max_examples // PART)
        setattr(test, SETTINGS, settings(own, max_examples=fewer))
