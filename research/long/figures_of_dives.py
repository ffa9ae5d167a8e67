"""In minutes: the figures that fly dives or long links say what they show, as the others do."""

import pytest

from research.tests.papers import test_figures
from research.tests.papers.test_figures import LONG, entry


@pytest.mark.parametrize("id_", LONG)
def test_a_figure_of_dives_names_its_source_axes_and_units(id_: str) -> None:
    test_figures.test_a_figure_names_its_source_axes_and_units_and_every_curve_is_finite(entry(id_))
