"""The whole chain on virtual time: what a pilot may rely on, whatever he and the link do."""

import hashlib
import json
from pathlib import Path

import pytest

from messages import topics
from messages.link import LatencyBudget
from services.vehicle_view.view import Newest, vehicle_view
from tests.support.dive import ON_BOARD, Dive, Person
from tools.__main__ import main
from tools.recordings.recording import open_recording


def depth_after_release(dive: Dive, seconds: float) -> list[float]:
    truth = dive.heard(topics.TRUTH)
    dive.run(seconds)
    return [each.position[2] for each in truth]


def test_the_drone_stops_where_the_stick_was_let_go() -> None:
    dive = Dive("0,0,0,0,0\n1,0,0,1,0\n7,0,0,0,0\n30,0,0,0,0")
    references, truth = dive.heard(topics.REFERENCE), dive.heard(topics.TRUTH)
    dive.until_armed().run(7.0)
    let_go = truth[-1].position[2]
    depths = depth_after_release(dive, 10.0)
    final = references[-1].depth.position
    assert final - let_go < 0.75  # it is on its way down at 0.5 m/s
    assert max(depths) - final <= 0.10
    assert max(abs(depth - final) for depth in depths[-500:]) <= 0.05


def test_a_pilot_who_vanishes_leaves_the_drone_holding_its_depth() -> None:
    dive = Dive("0,0,0,0,0\n1,0.5,0,0.6,0\n60,0,0,0,0").until_armed().run(4.0)
    references = dive.heard(topics.REFERENCE)
    dive.host.kill("gamepad")
    dive.run(6.0)
    assert dive.statuses[-1].failsafe == "pilot_lost"
    depths = depth_after_release(dive, 5.0)
    assert max(depths) - min(depths) < 0.10
    assert references[-1].surge_force == 0.0


def test_dead_control_means_thrusters_stop_within_their_time_to_live() -> None:
    dive = Dive("0,0,0,0,0\n1,1,0,0,0\n60,0,0,0,0").until_armed().run(4.0)
    dive.host.kill("control")
    dive.run(1.2)
    assert dive.host.nodes["simulator"].counts["stale:control/thrusters"] == 1


@pytest.mark.slow
def test_the_same_seed_gives_the_same_bytes_and_another_seed_others() -> None:
    def digest(seed: int) -> str:
        dive = Dive("0,0,0,0,0\n1,0.5,0,1,0.3\n3,0,0,0,0", seed=seed)
        sha = hashlib.sha256()
        for side in ("drone", "topside"):
            dive.host.side(side).hear("**", lambda e: sha.update(e.key.encode() + e.payload))
        dive.run(8.0)
        return sha.hexdigest()

    assert digest(1) == digest(1)
    assert digest(1) != digest(2)


def test_a_link_that_is_cut_is_told_from_a_pilot_who_is_silent() -> None:
    dive = Dive(services=(*ON_BOARD, "tether", "link_monitor"))
    pilot = Person(dive.host, side="topside")
    dive.run(6.0)
    assert pilot.ask("arm") == ""
    dive.host.kill("tether")
    dive.run(0.6)
    assert dive.statuses[-1].conditions == ("pilot_lost",)
    dive.run(1.0)
    assert dive.statuses[-1].conditions == ("link_lost", "pilot_lost")
    assert dive.statuses[-1].failsafe == "link_lost"
    pilot.speaks = False
    dive.start("tether")
    dive.run(1.0)
    assert dive.statuses[-1].conditions == ("pilot_lost",)
    assert dive.statuses[-1].failsafe == "pilot_lost"  # the link is there again, he is not
    assert pilot.ask("resume") == "pilot lost: no stick positions arrive, still"


OUTAGES = "t,surge,sway,heave,yaw,event\n0,0,0,0.5,0,\n"
BEGAN_S, S = 4.0, 1e9


def test_an_outage_is_one_number_everywhere(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    at, rows, outages = BEGAN_S, OUTAGES, (1.5, 0.2, 2.0)
    for seconds in outages:
        rows += f"{at},0,0,0,0,link down\n{at + seconds},0,0,0,0,link up\n"
        at += seconds + 4.0
    script = tmp_path / "outages.csv"
    script.write_text(f"{rows}{at},0,0,0,0,\n")
    out = tmp_path / "dive"
    options = ("--pilot", f"script:{script}", "--link", "tether", "--out", str(out))
    assert main(["simulate", *options]) in (0, 3)
    lost_s = sum(seconds for seconds in outages if seconds > 0.5)  # less is not seen
    said = [
        one.message
        for one in open_recording(out)
        if one.key == topics.LATENCY.key and isinstance(one.message, LatencyBudget)
    ]
    assert said[-1].lost_s == pytest.approx(lost_s, abs=0.1 * len(outages) + 0.001)
    assert json.loads((out / "report.json").read_text())["budget_ms"]["lost_s"] == pytest.approx(
        said[-1].lost_s, abs=0.001
    )
    words = f"the pilot saw nothing of the drone for {said[-1].lost_s:.1f} s"
    assert words in capsys.readouterr().out
    seen = vehicle_view(Newest(latency=said[-1]), said[-1].stamp_ns)
    assert seen.lost_s == round(said[-1].lost_s, 1)
