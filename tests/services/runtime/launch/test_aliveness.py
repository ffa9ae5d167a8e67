"""A service is alive on all of its sides, or it is missing."""

from pathlib import Path

from hypothesis import given
from hypothesis import strategies as st

from services.runtime.hosts.registry import Registry
from services.runtime.hosts.stack_file import ServiceSpec
from services.runtime.launch.aliveness import Aliveness

SERVICES = Registry(
    Path("x.toml"),
    {
        "tether": ServiceSpec(sides=["topside", "drone"]),
        "control": ServiceSpec(sides=["drone"], process="onboard"),
        "reference": ServiceSpec(sides=["drone"], process="onboard"),
        "gamepad": ServiceSpec(sides=["topside"]),
    },
)
TOKENS = st.tuples(
    st.sampled_from(["topside", "drone"]), st.sampled_from([*SERVICES, "foreign"]), st.booleans()
)


@given(st.lists(TOKENS, max_size=30))
def test_missing_is_whoever_shows_no_token_on_one_of_its_sides(
    tokens: list[tuple[str, str, bool]],
):
    alive, shown = Aliveness(SERVICES, ("topside", "drone")), set[tuple[str, str]]()
    for side, service, there in tokens:
        (shown.add if there else shown.discard)((side, service))
        whole = alive.token(side, service, shown=there)
        missing = {
            name
            for name, spec in SERVICES.items()
            if any((side, name) not in shown for side in spec.sides)
        }
        assert set(alive.missing()) == missing
        members = SERVICES.processes.get(whole or "", [])
        assert not missing & set(members)
        assert whole is None or there


@given(st.permutations(["control", "reference"]))
def test_a_process_is_whole_with_the_last_of_its_services(order: list[str]):
    alive = Aliveness(SERVICES, ("topside", "drone"))
    first, last = order
    assert alive.token("drone", first, shown=True) is None
    assert alive.token("drone", last, shown=True) == "onboard"
    assert alive.token("drone", last, shown=False) is None
    assert last in alive.missing()


def test_a_side_without_a_hub_on_this_machine_is_not_waited_for():
    alive = Aliveness(SERVICES.only({"tether": SERVICES["tether"]}), ("topside",))
    assert alive.token("topside", "tether", shown=True) == "tether"
    assert alive.missing() == []
