"""What the pilot is told of the link: risen delays, silence, floods of junk; and both of its
ends."""

from collections import Counter
from collections.abc import Sequence
from random import Random

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from messages import topics
from messages.control import ThrusterCommand
from messages.events import note
from messages.health import Health
from messages.link import DOWN_STAGES, Clock, LatencyBudget, Shown
from messages.message import Notice
from messages.state import VehicleState
from services.link_monitor.core import JunkWatch, LinkAlarm
from services.link_monitor.latency_account import LatencyAccount
from services.runtime.bus.envelope import Envelope
from services.runtime.config.stack import Stack
from services.runtime.hosts.registry import Registry
from services.runtime.hosts.stack_file import ServiceSpec
from services.runtime.hosts.virtual_host import Skew, VirtualHost
from services.runtime.node.loop_stats import LoopStats
from tests.support import said
from tools.up import on_side

MS, S = 1_000_000, 1_000_000_000
PING = S // 5


def sound(rtts_ms: Sequence[float | None]) -> list[tuple[int, str]]:
    """The alarm's text every 50 ms, for pings that take this long (None: never come back)."""
    alarm, texts = LinkAlarm(), list[tuple[int, str]]()
    back = sorted(
        (k * PING + round(rtt * MS), rtt) for k, rtt in enumerate(rtts_ms) if rtt is not None
    )
    for now in range(0, len(rtts_ms) * PING, 50 * MS):
        while back and back[0][0] <= now:
            alarm.answered(back.pop(0)[1])
        if now % PING == 0:
            alarm.sent(now)
        texts.append((now, note(filter(None, [alarm.notice(now)]))))
    return texts


@given(rtt=st.floats(0.1, 400.0), jitter=st.floats(0.0, 40.0), random=st.randoms())
def test_a_link_as_it_always_is_raises_no_alarm(rtt: float, jitter: float, random: Random) -> None:
    pings: list[float | None] = [rtt + jitter * random.random() for _ in range(60)]
    assert {text for now, text in sound(pings) if now > rtt * MS + PING} == {""}


@given(before=st.floats(0.1, 100.0), rise=st.floats(2.0, 50.0))
def test_a_rise_is_told_within_a_second_beyond_the_new_delay(before: float, rise: float) -> None:
    after = before * rise + 60.0
    texts = sound([before] * 50 + [after] * 50)
    limit = 50 * PING + S
    assert all(text == "" for now, text in texts if now < 50 * PING)
    told = next(now for now, text in texts if text)
    assert told <= limit


def test_silence_is_told_and_its_end_too() -> None:
    texts = sound([20.0] * 20 + [None] * 20 + [20.0] * 20)
    told = [now for now, text in texts if text]
    assert 20 * PING + 500 * MS <= told[0] <= 20 * PING + S
    assert told[-1] <= 40 * PING + 100 * MS


def test_before_the_first_answer_nothing_is_known_and_that_is_said() -> None:
    assert sound([None] * 20)[-1][1] == "no answer from the drone yet"


def health(counts: dict[str, int], service: str = "control", instance: int = 0) -> Health:
    told = LoopStats().report(service, 0, 0, 0, Counter(counts), None, "drone")
    return msgspec.structs.replace(told, instance=instance)


@given(st.lists(st.integers(0, 60), min_size=2, max_size=20))
def test_more_than_so_many_in_a_second_are_a_flood(more: list[int]) -> None:
    """Of one process, at any time since its start; not what it could read, and no sensor."""
    watch, total = JunkWatch(), 5000
    watch.health(health({"malformed:state": total}), 0)
    for second, number in enumerate(more, 1):
        total += number
        others = {"expired:x": 9**9 * second, "malformed:sensor/imu": 9**9 * second}
        watch.health(health({"malformed:state": total, **others}), second * S)
        floods = [n > 20 for n in more[max(0, second - 3) : second]]
        assert bool(watch.notice(second * S)) == any(floods)
    watch.health(health({"malformed:state": 3}), (len(more) + 4) * S)  # it has started again
    assert watch.notice((len(more) + 4) * S) is None


@given(st.lists(st.tuples(st.integers(0, 1), st.integers(0, 5)), max_size=30))
def test_two_topsides_of_one_drone_are_no_flood(reports: list[tuple[int, int]]) -> None:
    watch, counted = JunkWatch(), [0, 30]  # since their starts
    for at, (topside, more) in enumerate(reports):
        counted[topside] += more
        watch.health(
            health({"malformed:state": counted[topside]}, "recorder_topside", topside), at * S // 2
        )
        assert watch.notice(at * S // 2) is None


def test_however_many_processes_there_were_a_flood_is_noticed() -> None:
    watch = JunkWatch()
    for number in range(1000):
        watch.health(health({}, instance=number), number * S)
    for second in range(3):
        watch.health(health({"malformed:x": 100 * second}, "new"), (1000 + second) * S)
    assert watch.notice(1002 * S) == Notice("alarm:junk", {"hz": 100}, ("new",))


def test_the_pilot_reads_of_a_flood_and_of_its_end_and_of_no_other_lindy() -> None:
    host = VirtualHost()
    rows, stack = Registry.read(), Stack()
    for name in ("link_monitor", "gamepad"):
        host.add(name, rows[name], stack)
    alarms: list[str] = []
    told: list[str] = []
    screen = host.node("screen", ["topside"])
    screen.each(topics.LATENCY, lambda budget, _: alarms.append(note(budget.alarms)))
    screen.each(topics.LOG, lambda line, _: told.append(line.text))
    port = host.side("topside")

    def spit(_: int) -> None:
        for topic in topics.ALL:
            key = topic.key.replace("*", "stranger")
            port.forward(Envelope(key, b"\xc1junk", topic.encoding))
            port.forward(Envelope(key, b"\x81\xa6source\xa1\xff", topic.encoding))

    junk = host.node("junk", ["topside"])
    junk.every(50.0, spit)
    host.run(4 * S)
    assert "a second, gamepad)" in alarms[-1]
    assert [text for text in told if "another Lindy" in text or "unknown version" in text] == []
    host.kill("junk")
    host.run(9 * S)
    assert "cannot read" not in alarms[-1]
    assert sum("cannot read" in text for text in told) == 1


EVERY = Registry.read()
ROWS = EVERY.only({name: EVERY[name] for name in ("tether", "link_monitor")})


@pytest.mark.parametrize("ahead", [None, 0, 3_600 * S])
def test_pings_are_answered_from_the_other_realm(ahead: int | None) -> None:
    host = VirtualHost(None if ahead is None else {"drone": Skew(ahead)})
    rows = ROWS if ahead is None else ROWS.apart()
    host.add_all(rows, Stack(link="remote", apart=ahead is not None))
    clocks, health = list[Clock](), dict[str, Health]()
    ears = host.node("ears", ["topside"])
    ears.each(topics.CLOCK, lambda m, _: clocks.append(m))
    ears.each(topics.HEALTH, lambda m, _: health.update({m.service: m}))
    host.run(3 * S)
    assert clocks[-1].rtt_ms is not None
    assert clocks[-1].rtt_ms >= 100.0  # over the link and back, not from neighbour to neighbour
    assert clocks[-1].offset_ns is not None
    assert clocks[-1].bound_ns is not None
    assert abs(clocks[-1].offset_ns - (ahead or 0)) <= clocks[-1].bound_ns
    assert set(rows) <= set(health)


def test_once_the_drone_has_answered_the_topside_says_again_who_it_is_and_its_clock() -> None:
    """What was said before the two have met was heard by nobody."""
    host = VirtualHost({"drone": Skew(5 * S)})
    host.add_all(ROWS.apart(), Stack(link="remote", apart=True))
    said, answered, known = list[int](), list[int](), list[int]()
    ears = host.node("ears", ["topside"])
    ears.each(topics.IDENTITY.of("topside"), lambda _, now: said.append(now))
    ears.each(topics.CLOCK_PONG, lambda _, now: answered.append(now))
    ears.each(topics.CLOCK, lambda m, now: known.append(now) if m.offset_ns is not None else None)
    host.run(3 * S)
    assert said.count(answered[0]) == 1
    assert known[0] == answered[0]


def test_on_two_machines_no_name_is_there_twice() -> None:
    topside, drone = (on_side(EVERY, side, gateway=False) for side in ("topside", "drone"))
    assert set(topside) & set(drone) == set()
    assert topside["link_monitor"] == ServiceSpec(sides=["topside"], service="link_monitor")
    assert drone["link_monitor_drone"] == ServiceSpec(sides=["drone"], service="link_monitor")


# The stages add up to the whole, and nothing is said that is not known.


PERIOD = 20 * MS
ways = st.lists(
    st.tuples(*(st.integers(0, 80) for _ in range(5))), min_size=10, max_size=60
)  # [ms] pad, link, reference, control, thruster


def at_rest(sensed: int) -> VehicleState:
    return said.state(sensed + 2 * MS, sensor_ns=sensed)


def fly(budget: LatencyAccount, k: int, way: tuple[int, ...]) -> int:
    """One command from the stick to the thruster. Returns when its telemetry is back."""
    pad, link, reference, control, thruster = way
    sent = k * PERIOD
    budget.command(said.sticks(sent, device_age_ms=pad), sent + MS)
    referred = sent + MS + (link + reference) * MS
    commanded = referred + control * MS
    done = commanded + thruster * MS
    now = done + 10 * MS
    budget.ping(float(link), now)
    budget.reference(said.reference(referred, sensor_ns=None, pilot_ns=sent), now)
    thrust = ThrusterCommand(stamp_ns=commanded, sensor_ns=None, pilot_ns=sent, thrust=())
    budget.thrusters(thrust, now)
    budget.actuation(said.actuation(done, pilot_ns=sent), now)
    return now


@given(ways=ways)
def test_the_stages_add_up_to_the_median_from_end_to_end(ways: list[tuple[int, ...]]) -> None:
    budget = LatencyAccount()
    for _ in range(5):
        budget.ping(0.0, 0)  # before the first answers the link's share is not known
    now = max(fly(budget, k, way) for k, way in enumerate(ways))
    said = budget.report(now, None, ())
    assert said.down is not None
    assert tuple(stage.name for stage in said.down) == DOWN_STAGES
    totals = sorted(pad + 1 + sum(rest) for pad, *rest in ways)
    low, high = (
        totals[len(totals) * 2 // 5 - 1],
        totals[min(len(totals) - 1, len(totals) * 3 // 5 + 1)],
    )
    assert low - 1e-6 <= sum(stage.p50_ms for stage in said.down) <= high + 1e-6
    whole = said.stick_to_thruster_ms or 0.0
    assert whole == totals[len(totals) // 2]
    assert abs(sum(stage.p50_ms for stage in said.down) - whole) <= 0.05 * whole


@given(way=st.tuples(*(st.integers(0, 80) for _ in range(5))))
def test_a_steady_way_is_told_stage_by_stage(way: tuple[int, ...]) -> None:
    budget = LatencyAccount()
    now = [fly(budget, k, way) for k in range(20)][-1]
    said = budget.report(now, 0.1, ())
    assert said.down is not None
    pad, link, reference, control, thruster = way
    wanted = (pad, 1, link, reference, control, thruster)
    assert all(abs(s.p50_ms - ms) < 1e-6 for s, ms in zip(said.down, wanted, strict=True))
    assert abs((said.stick_to_thruster_ms or 0.0) - sum(wanted)) <= 0.05 * sum(wanted)


def test_what_is_old_is_not_said() -> None:
    budget = LatencyAccount()
    now = [fly(budget, k, (1, 1, 1, 1, 1)) for k in range(20)][-1]
    assert budget.report(now, None, ()).down is not None
    later = budget.report(now + 3_000 * MS, None, ())
    assert later.down is None
    assert later.stick_to_thruster_ms is None


def test_the_way_back_adds_up_too_and_is_unknown_without_a_screen() -> None:
    budget = LatencyAccount()
    for k in range(20):
        sensed = k * 10 * MS
        budget.state(at_rest(sensed), sensed + 32 * MS)
    assert budget.report(300 * MS, None, ()).up is None
    for k in range(8):
        budget.shown(Shown(stamp_ns=k * 250 * MS + 50 * MS, sensor_ns=k * 250 * MS), 300 * MS)
    report = budget.report(300 * MS, None, ())
    assert report.up is not None
    assert [round(stage.p50_ms) for stage in report.up] == [2, 30, 18]
    assert report.sensor_to_screen_ms == 50.0


def test_a_command_that_was_held_up_for_longer_than_the_budget_looks_back_is_no_trouble() -> None:
    budget = LatencyAccount()
    for late in (0, 1_000, 2_001, 60_000):
        budget.command(said.sticks(), late * MS)
    assert budget.report(60_000 * MS, None, ()).down is None


@given(error=st.integers(-500, 500), delay=st.integers(0, 400))
def test_two_clocks_that_disagree_give_no_time_below_zero(error: int, delay: int) -> None:
    """`error` [ms] is how far the drone's stamps are off after the clocks were compared."""
    budget, now = LatencyAccount(), 0
    for k in range(20):
        sent = 100 * S + k * PERIOD
        done, now = sent + (delay + error) * MS, sent + 2 * delay * MS
        budget.command(said.sticks(sent), sent)
        budget.ping(float(delay), now)
        for hear, message in (
            (budget.reference, said.reference(done, sensor_ns=None, pilot_ns=sent)),
            (
                budget.thrusters,
                ThrusterCommand(stamp_ns=done, sensor_ns=None, pilot_ns=sent, thrust=()),
            ),
            (budget.actuation, said.actuation(done, pilot_ns=sent)),
            (budget.shown, Shown(stamp_ns=now, sensor_ns=done)),
        ):  # fmt: skip
            hear(message, now)  # type: ignore[operator]
    report = budget.report(now, 500.0, ())
    # The receiver decodes it again, and refuses a time below zero.
    again = msgspec.msgpack.decode(msgspec.msgpack.encode(report), type=LatencyBudget)
    assert again == report
    assert again.stick_to_thruster_ms is not None


@given(arrivals=st.lists(st.integers(1, 3000), max_size=60), after=st.integers(0, 5000))
def test_lost_is_the_time_in_which_no_state_arrived(arrivals: list[int], after: int) -> None:
    """Also while the pause lasts. A message that another one replaces at once is not missed."""
    budget, now = LatencyAccount(), 0
    assert budget.report(50 * S, None, ()).lost_s == 0.0  # nothing was there yet
    for pause_ms in (0, *arrivals):
        now += pause_ms * MS
        budget.state(at_rest(now), now)
    pauses = [pause for pause in (*arrivals, after) if pause > 500]
    assert round(budget.report(now + after * MS, None, ()).lost_s * 1000) == sum(pauses)
