"""The picture of the imports shows all there is, and imports go downwards in it."""

import grimp
import pytest

from services.runtime.hosts.service_module import own_services
from tests.support.docs.import_picture import BOXES, ROOTS, arrows_of, box_of, rendered


@pytest.fixture(scope="module")
def graph() -> grimp.ImportGraph:
    return grimp.build_graph(*ROOTS, cache_dir=None)


def test_every_package_of_the_services_has_a_box_of_its_own(graph: grimp.ImportGraph) -> None:
    packages = {name for name in graph.find_children("services") if graph.find_children(name)}
    assert packages == {name for name in BOXES if name.startswith("services.")}
    assert {f"services.{name}" for name in own_services()} <= packages


def test_no_arrow_among_the_services_goes_upwards(graph: grimp.ImportGraph) -> None:
    arrows = [arrow for arrow in arrows_of(graph) if arrow[0].startswith("services")]
    assert ("services.vehicle", "services.marine") in arrows
    assert [(a, b) for a, b in arrows if BOXES[a].y < BOXES[b].y] == []


def test_a_module_is_in_the_smallest_box_around_it() -> None:
    assert box_of("services.reference.paths.path") == "services.reference"
    assert box_of("tools.simulate") == "tools"
    assert box_of("services.__main__") == "services"


def test_the_same_imports_give_the_same_bytes(graph: grimp.ImportGraph) -> None:
    assert rendered(graph, "svg") == rendered(graph, "svg")
