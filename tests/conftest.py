"""Every run of the tests is the same run, on any machine: the property tests draw the same cases.

New cases are searched for by `make explore` alone (tests/long/explore.py). A case found there is
kept as an `@example` of its test.
"""

import pytest
from hypothesis import HealthCheck, Phase, settings
from hypothesis.internal.constants_ast import Constants

settings.register_profile(
    "same",
    max_examples=60,  # `make explore` draws more, and others
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
settings.load_profile("same")


@pytest.hookimpl(trylast=True)  # after `--hypothesis-profile` was obeyed
def pytest_configure() -> None:
    """Hypothesis also draws constants that it finds in the modules imported so far, which depends
    on who ran before in the same process, and on the constants. Not in the runs that are equal."""
    if settings().derandomize:
        pytest.MonkeyPatch().setattr(
            "hypothesis.internal.conjecture.providers._get_local_constants", Constants
        )
