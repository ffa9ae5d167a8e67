"""The depth observers through a step in depth: the thesis' and what follows from it."""

import numpy as np
from matplotlib.figure import Figure

from lindy_research.bench.depth_runs import DepthWorld, Sensor, lindy, thesis, world
from lindy_research.bench.thesis_depth import Way
from lindy_research.dives import Floats
from lindy_research.flights import Script, flown
from lindy_research.papers import style

SENSOR = Sensor("σ 5 cm", 0.05)
SEED = 3
DOWN, REST = (0.0, 0.0, 1.0, 0.0), (0.0, 0.0, 0.0, 0.0)
# Away from the surface, and then two metres down, long after the start.
STICK: Script = ((2.0, DOWN), (8.0, REST), (32.0, DOWN), (36.0, REST))
BEGIN, END = 30.0, 42.0  # [s] what is shown


# Process noises [m/s²/√Hz] with the least error of the rate for this sensor; Lindy's is as shipped.
OBSERVERS: tuple[tuple[Way | None, str, str, float], ...] = (
    ("hold", "thesis: sampled and held", style.PAPER, 0.07),
    ("timed", "timed", style.FILTER, 0.1),
    ("reference", "timed, reference's acceleration", style.DIRECT, 0.05),
    (None, "Lindy: timed, accelerometer with biases", style.LINDY, 0.0),
)


def depth_step(figure: Figure) -> str:
    seen = world(SENSOR, SEED, flown(STICK, END + 5.0))
    panels = style.stacked(
        figure, "depth\n[m]", "error of depth\n[mm]", "depth rate\n[m/s]", "error of rate\n[mm/s]"
    )
    shown = (seen.t >= BEGIN) & (seen.t <= END)
    t = seen.t[shown] - BEGIN
    _samples(figure, seen)
    truth: style.Look = {"color": style.TARGET, "linewidth": 3.5, "alpha": 0.6, "label": "truth"}
    panels[0].plot(t, seen.depth[shown], **truth)
    panels[2].plot(t, seen.rate[shown], **truth)
    errors: list[str] = []
    for way, name, colour, noise in OBSERVERS:
        found = lindy(seen, SENSOR.settings()) if way is None else thesis(seen, way, SENSOR, noise)
        depth, rate = found.depth - seen.depth, found.rate - seen.rate
        # The first two nearly coincide: one is drawn broad, to show on both sides of the other.
        look: style.Look = {
            "color": colour,
            "label": name,
            "linewidth": 2.4 if way == "hold" else 1.2,
        }
        panels[0].plot(t, found.depth[shown], **look)
        panels[1].plot(t, 1e3 * depth[shown], **look)
        panels[2].plot(t, found.rate[shown], **look)
        panels[3].plot(t, 1e3 * rate[shown], **look)
        off, slow = 1e3 * _rms(depth[shown]), 1e3 * _rms(rate[shown])
        errors.append(f"{way or 'Lindy'} {off:.1f} mm, {slow:.1f} mm/s")
    panels[0].invert_yaxis()  # down is down
    for panel in (panels[1], panels[3]):
        panel.axhline(0.0, **style.EDGE)
    handles, labels = panels[0].get_legend_handles_labels()
    panels[0].legend(
        handles, labels, ncols=3, loc="lower center", bbox_to_anchor=(0.5, 1.0), columnspacing=1.4
    )
    return (
        "The simulated vehicle, pressure σ 5 cm at 42 Hz, observers at 100 Hz, steps of 0.5 m/s, "
        "swell of 0.03 m/s rms at 0.25 Hz, which the reference does not know. Process noise tuned "
        f"for each. Errors rms over what is shown: {'; '.join(errors)}. A filter that must guess "
        "the motion from pressure comes late, whatever it knows of the samples' times; the "
        "accelerometer takes the lag away."
    )


def _samples(figure: Figure, seen: DepthWorld) -> None:
    """What the pressure sensor says, behind everything else."""
    there = (seen.stamps >= BEGIN) & (seen.stamps <= END)
    figure.axes[0].plot(
        seen.stamps[there] - BEGIN, seen.said[there], ".",
        color=style.LIMIT, markersize=2.5, alpha=0.6, label="pressure samples",
    )  # fmt: skip


def _rms(errors: Floats) -> float:
    return float(np.sqrt(np.mean(errors * errors)))
