"""Both headings beside the plain filter while the vehicle passes iron."""

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from lindy_research import heading_runs as runs
from lindy_research.dives import Floats
from lindy_research.papers import style

SECONDS = 100.0  # [s] after calibration
AT, FOR, STRENGTH = 50.0, 20.0, 20e-6  # [s], [s], [T]
SEED = 1


def disturbance(figure: Figure) -> str:
    """Heading through a magnetic disturbance of 20 µT for 20 s."""
    flight = runs.dive(SECONDS)
    iron = runs.passing_iron(len(flight.heading), AT, FOR, STRENGTH)
    samples = runs.measured(flight, SEED, runs.TYPICAL, iron)
    seen, plain = runs.observed(flight, samples), np.degrees(runs.plain(flight, samples))
    control, navigation = np.degrees(seen.control), np.degrees(seen.navigation)
    true, t = np.degrees(flight.heading), flight.t
    heading, error, near = style.stacked(
        figure, "heading [°]", "error [°]", "error, ours [°]", x="time [s]"
    )
    for panel in (heading, error, near):
        panel.axvspan(AT, AT + FOR, color="#EEEEEE", zorder=0)

    def draw(panel: Axes, values: Floats, label: str, **look: Any) -> None:
        known = np.isfinite(values)  # a heading that is not calibrated yet is no curve
        panel.plot(t[known], values[known], label=label, **look)

    draw(heading, true + plain, "plain filter", color=style.PAPER)
    draw(heading, true + navigation, "navigation", color=style.DIRECT, linewidth=2.6)
    heading.plot(t, true, label="truth", **style.OURS)
    style.legend(heading, 3)
    draw(error, plain, "plain filter", color=style.PAPER)
    for panel in (error, near):
        draw(panel, navigation, "navigation", color=style.DIRECT)
        draw(panel, control, "control", color=style.FILTER)
    std = np.degrees(seen.std)
    band: style.Look = {"color": style.LIMIT, "linewidth": 0.9, "linestyle": ":"}
    draw(near, std, "one standard deviation", **band)
    draw(near, -std, "", **band)
    style.legend(error, 3)
    style.legend(near, 3)
    near.set_xlim(0.0, float(t[-1]))
    inside = (t >= AT) & (t <= AT + FOR + 10.0)
    peak_plain, peak = np.max(np.abs(plain[inside])), np.max(np.abs(navigation[inside]))
    drifted = control[inside] - control[inside][0]
    return (
        f"A field of {STRENGTH * 1e6:.0f} µT towards east for {FOR:.0f} s (grey) on top of the "
        f"Earth's 15 µT towards north. A filter that follows the compass (Madgwick 2010, with "
        f"magnetometer) is off by up to {peak_plain:.0f}°. The navigation heading sees that "
        f"strength, dip and gyroscope disagree, goes on with the gyroscope and comes back "
        f"{3:.0f} s after the field has; peak error {peak:.1f}°. The control heading has no "
        f"magnetometer: it moves by {np.max(np.abs(drifted)):.2f}° in the same time. The simulated "
        f"vehicle with a typical MEMS unit, its accelerometer bias and hard iron."
    )
