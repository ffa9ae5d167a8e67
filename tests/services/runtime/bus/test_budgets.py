"""Who has used up the budget of its role."""

from hypothesis import given
from hypothesis import strategies as st

from services.runtime.bus.budgets import BARRED_S, BUDGETS, LONGEST_BARRED_S, Budgets, Verdict
from services.runtime.bus.tcp_links import Ends

LOOK_NS = 50_000_000
EVE, ANN = "observer:eve", "pilot:ann"
ROLES = st.sampled_from(sorted(BUDGETS))


def link(number: int = 0) -> Ends:
    return Ends("127.0.0.1:7447", f"127.0.0.1:{40_000 + number}")


def flown(name: str, rate: float, seconds: float, links: int = 1) -> list[tuple[float, Verdict]]:
    """What is said of somebody who sends so many [bytes/s], and when [s]."""
    budgets, found = Budgets(frozenset({name})), list[tuple[float, Verdict]]()
    there = {link(number): name for number in range(links)}
    for look in range(round(seconds * 1e9 / LOOK_NS)):
        now = look * LOOK_NS
        sent = {each: round(rate * now / 1e9 / links) for each in there}
        found += [(now / 1e9, verdict) for verdict in budgets.look(there, sent, now)]
    return found


@given(ROLES, st.floats(0.0, 1.0), st.integers(1, 8))
def test_whoever_stays_within_the_rate_is_never_warned(role: str, share: float, links: int) -> None:
    assert flown(f"{role}:x", share * BUDGETS[role].rate, 20.0, links) == []


@given(ROLES, st.floats(2.0, 50.0), st.integers(1, 8))
def test_a_flood_is_warned_of_once_and_then_cut_off(role: str, times: float, links: int) -> None:
    budget = BUDGETS[role]
    full_s = budget.burst / (times * budget.rate - budget.rate)
    said = [
        verdict.what for _, verdict in flown(f"{role}:x", times * budget.rate, full_s + 2, links)
    ]
    assert said == ["warn", "cut"]


def test_twenty_thousand_messages_a_second_of_an_observer_last_a_tenth_of_a_second() -> None:
    (warned_s, warned), (cut_s, cut) = flown(EVE, 20_000 * 66.0, 1.0)
    assert (warned.what, cut.what, cut.barred_s) == ("warn", "cut", BARRED_S)
    assert warned_s < cut_s <= 0.15


def test_a_flood_shared_by_several_links_is_of_one_certificate() -> None:
    assert [v for _, v in flown(EVE, 1e6, 1.0, links=8)] == [v for _, v in flown(EVE, 1e6, 1.0)]


def test_more_links_than_a_role_needs_are_cut_off_after_a_warning() -> None:
    why = "too many links"
    (_, first), (_, second) = flown(EVE, 0.0, 0.2, links=9)
    assert (first, second) == (Verdict(EVE, "warn", why), Verdict(EVE, "cut", why, BARRED_S))
    assert flown(EVE, 0.0, 0.2, links=8) == []


def test_who_goes_on_is_barred_for_longer_each_time_and_others_are_not_touched() -> None:
    budgets, sent, cuts, now = Budgets(frozenset({EVE, ANN})), 0, list[Verdict](), 0
    assert not budgets.barred(EVE, now)
    while len(cuts) < 9:
        now, sent = now + LOOK_NS, sent + 100_000
        said = budgets.look({link(): EVE, link(1): ANN}, {link(): sent, link(1): 100}, now)
        assert all(verdict.name == EVE for verdict in said)
        cuts += [verdict for verdict in said if verdict.what == "cut"]
        assert budgets.barred(EVE, now) == any(v.what == "cut" for v in said) or now < max(
            budgets.buckets[EVE].barred_until, 1
        )
        assert not budgets.barred(ANN, now)
    lasted = [verdict.barred_s for verdict in cuts]
    assert lasted[:3] == [BARRED_S, 2 * BARRED_S, 4 * BARRED_S]
    assert lasted[-1] == LONGEST_BARRED_S


def test_a_port_that_is_used_again_begins_at_zero() -> None:
    budgets = Budgets(frozenset({EVE}))
    budgets.look({link(): EVE}, {link(): 60_000}, 0)
    budgets.look({}, {}, LOOK_NS)
    assert budgets.look({link(): EVE}, {link(): 100}, 2 * LOOK_NS) == []


@given(st.integers(0, 20))
def test_of_those_barred_the_oldest_links_are_cut(many: int) -> None:
    budgets = Budgets(frozenset({EVE, ANN}))
    links = {link(number): EVE for number in range(many)}
    assert budgets.beyond(links, 0) == []
    for look in range(2):
        budgets.look({link(90): EVE}, {link(90): 1_000_000}, look)
    budgets.look({link(90): EVE}, {link(90): 2_000_000}, 2)
    assert budgets.barred(EVE, 2)
    expected = {link(number) for number in range(many - 8)}
    assert {*budgets.beyond({**links, link(99): ANN}, 2)} == expected


def test_who_is_not_admitted_has_the_least_budget() -> None:
    budgets = Budgets(frozenset({EVE}))
    said = [budgets.look({link(): "router:gone"}, {link(): 200_000 * n}, n) for n in range(3)]
    assert [verdict.what for each in said for verdict in each] == ["warn", "cut"]


def test_a_count_that_fails_for_a_moment_makes_no_flood_of_the_past() -> None:
    """Without free descriptors a link cannot be asked."""
    budgets = Budgets(frozenset({ANN}))
    for second in range(1, 31):  # 3 MB in all, within the rate
        received = {} if second == 20 else {link(): 100_000 * second}
        assert budgets.look({link(): ANN}, received, second * 1_000_000_000) == []


def test_asking_who_is_barred_opens_no_account() -> None:
    budgets = Budgets(frozenset({ANN}))
    assert not budgets.barred(EVE, 0)
    assert budgets.buckets == {}
