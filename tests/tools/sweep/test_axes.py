"""SweepAxes of a sweep: what the command line means, and every mistake in one sentence."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from services.runtime.config.errors import LindyError
from tools.sweep.axes import SweepAxes, axes


def read(**options: str) -> SweepAxes:
    given = {name: [text] for name, text in options.items()}
    defaults = {"vehicle": ["pioneer"], "link": ["tether"], "pilot": ["script:a"], "seed": ["0"]}
    return axes(**{"settings": [], **defaults, **given})


words = st.text("abcxyz_0123456789.-", min_size=1, max_size=6)
several = st.lists(words, min_size=1, max_size=4, unique=True)


@given(several, several, several, st.integers(0, 50), st.integers(1, 9))
def test_a_sweep_is_the_product_of_its_axes(
    vehicles: list[str], links: list[str], gains: list[str], first: int, many: int
):
    found = read(
        vehicle=",".join(vehicles),
        link=" , ".join(links),
        settings=f"control.depth.kp={','.join(gains)}",
        seed=f"{first}..{first + many - 1}",
    )
    dives = list(found.dives())
    assert len(dives) == found.count == len(vehicles) * len(links) * len(gains) * many
    assert [dive.number for dive in dives] == list(range(found.count))
    assert len({(dive.combination, dive.seed) for dive in dives}) == found.count
    assert {dive.combination.vehicle for dive in dives} == set(vehicles)
    assert {dive.combination.link for dive in dives} == set(links)
    assert {dive.seed for dive in dives} == set(range(first, first + many))
    wanted = {(f"control.depth.kp={gain}",) for gain in gains}
    assert {dive.combination.settings for dive in dives} == wanted


def test_a_comma_inside_brackets_or_quotes_is_part_of_a_value():
    found = read(settings="pd_control.depth=[80, 70],[60, 65]")
    assert found.settings == {"pd_control.depth": ("[80, 70]", "[60, 65]")}
    assert read(settings="a.b='x,y',z").settings == {"a.b": ("'x,y'", "z")}


def test_seeds_are_ranges_and_single_ones_in_the_order_given():
    assert read(seed="5..7,1,9").seed == (5, 6, 7, 1, 9)


def test_an_option_may_be_given_several_times():
    found = axes(
        ["pioneer"], ["tether", "severe,remote"], ["script:a"], ["a.b=1", "a.c=2,3"], ["0"]
    )
    assert found.link == ("tether", "severe", "remote")
    assert found.settings == {"a.b": ("1",), "a.c": ("2", "3")}
    assert found.varied == ["link", "a.c"]


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ({"link": ""}, "--link : a value is empty"),
        ({"link": "tether,,severe"}, "--link tether,,severe: a value is empty"),
        ({"vehicle": "pioneer,pioneer"}, "--vehicle names pioneer twice"),
        ({"settings": "control.depth.kp"}, "expected key.path=value"),
        ({"settings": "=3"}, "expected key.path=value"),
        ({"settings": "a.b=1,1"}, "--set a.b= names 1 twice"),
        ({"settings": "a.b="}, "a value is empty"),
        ({"seed": "9..1"}, "--seed 9..1 goes backwards; write 1..9"),
        ({"seed": "1..3,2"}, "--seed names 2 twice"),
        ({"seed": "one"}, "--seed 'one': expected whole numbers"),
        ({"seed": "-1"}, "--seed '-1': expected whole numbers"),
        ({"seed": "1.5"}, "--seed '1.5': expected whole numbers"),
        ({"seed": ""}, "--seed '': expected whole numbers"),
        ({"seed": "1..999999999999"}, "makes 999999999999 dives"),
        (
            {"seed": "1..600000", "link": "a,b"},
            "these axes make 1200000 dives; the most is 1000000",
        ),
    ],
)
def test_a_mistake_is_one_sentence(options: dict[str, str], says: str):
    with pytest.raises(LindyError) as error:
        read(**options)
    assert says in str(error.value)
