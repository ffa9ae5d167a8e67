"""What a link does to a pilot's sticks: Lindy beside a peer that acts on whatever arrives."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from lindy.api.links import named
from lindy_research.papers import style
from lindy_research.papers.link_flights import Floats, Followed, Stick, flown
from lindy_research.papers.link_naive import followed
from messages.pilot import TTL_MS

LINKS = ("tether", "remote", "congested", "flaky", "severe")
# Down, up, quick reversals, down again; released in an outage of `flaky` at 8.1 s and at 15.2 s.
STICK: Stick = (
    (0.0, 0.0), (1.0, 0.8), (4.0, 0.0), (6.0, -0.4), (8.1, 0.0), (10.0, 1.0), (10.5, -1.0),
    (11.0, 1.0), (11.5, 0.0), (13.0, 1.0), (15.2, 0.0),
)  # fmt: skip
SECONDS = 18.0
TITLES = ("depth of the reference", "age of the command that acts", "age of the newest state seen")
NAIVE: style.Look = {"color": style.DIRECT, "linewidth": 2.2}
BIN = 0.1  # [s]
AGES = (5.0, 30_000.0)  # [ms] shown
TTL = TTL_MS / 1e3  # [s]
LINDY: style.Look = {"color": style.LINDY, "linewidth": 1.2}


def five_links(figure: Figure) -> str:
    """The stick above, a row for each link: depth, age of what acts, age of what is seen."""
    heights = [0.7] + [1.0] * len(LINKS)
    grid = figure.add_gridspec(len(heights), 3, width_ratios=[5, 3, 3], height_ratios=heights)
    stick = figure.add_subplot(grid[0, 0])
    _draw_stick(stick)
    rows: list[list[Axes]] = []
    apart: dict[str, float] = {}
    for row, link in enumerate(LINKS, start=1):
        panels = [figure.add_subplot(grid[row, column], sharex=stick) for column in range(3)]
        flight = flown(link, STICK, SECONDS)
        ours, naive = flight.followed, followed(flight, link)
        _draw_link(panels, link, ours, naive)
        apart[link] = float(np.max(np.abs(np.interp(ours.t, naive.t, naive.depth) - ours.depth)))
        rows.append(panels)
    for panel in (stick, *(panel for panels in rows[:-1] for panel in panels)):
        panel.tick_params(labelbottom=False)
    for panel in rows[-1]:
        panel.set_xlabel("time [s]")
    for panel, title in zip(rows[0], TITLES, strict=True):
        panel.set_title(title, loc="left")
    drawn = [panel.get_legend_handles_labels() for panel in rows[0][:2]]
    legend = stick.legend(
        *([*one, *two] for one, two in zip(*drawn, strict=True)),
        loc="center left", bbox_to_anchor=(1.12, 0.5), borderaxespad=0.0,
    )  # fmt: skip
    legend.set_in_layout(False)  # it stands beside the panel, above the others
    figure.align_ylabels([stick, *(panels[0] for panels in rows)])
    return _caption(apart)


def _draw_stick(panel: Axes) -> None:
    t, heave = np.array([*STICK, (SECONDS, 0.0)]).T
    panel.step(t, heave, where="post", color=style.TARGET)
    panel.set_ylabel("heave\nstick [-]")
    panel.set_ylim(1.15, -1.15)
    panel.set_xlim(0.0, SECONDS)


def _draw_link(panels: list[Axes], link: str, ours: Followed, naive: Followed) -> None:
    depth, acts, seen = panels
    depth.plot(naive.t, naive.depth, label="naive peer", **NAIVE)
    depth.plot(ours.t, ours.depth, label="Lindy", **LINDY)
    depth.set_ylabel(f"{link}\n[m]")
    depth.invert_yaxis()
    _draw_worst(acts, naive.t, naive.age, NAIVE)
    _draw_worst(acts, ours.t, ours.age, LINDY)
    acts.axhline(1e3 * TTL, label=f"a command's time to live: {1e3 * TTL:.0f} ms", **style.EDGE)
    _draw_worst(seen, naive.t, naive.seen, NAIVE)
    _draw_worst(seen, ours.t, ours.seen, LINDY)
    for panel in (acts, seen):
        panel.set_yscale("log")
        panel.set_ylim(*AGES)
        panel.set_ylabel("[ms]")
    for window in named(link).profile.down.outages.windows:
        if window.start_s < SECONDS:
            for panel in panels:
                panel.axvspan(window.start_s, window.end_s, color=style.LIMIT, alpha=0.2, lw=0)


def _draw_worst(panel: Axes, t: Floats, age: Floats, look: style.Look) -> None:
    """The oldest [ms] in every tenth of a second, with a gap where there is nothing."""
    bins = np.floor(t / BIN).astype(int)
    known = np.isfinite(age)
    worst = {int(b): 1e3 * float(np.max(age[known & (bins == b)])) for b in np.unique(bins[known])}
    pieces: list[list[int]] = []
    for b in worst:
        if pieces and b == pieces[-1][-1] + 1:
            pieces[-1].append(b)
        else:
            pieces.append([b])
    for piece in pieces:
        panel.plot([BIN * (b + 0.5) for b in piece], [worst[b] for b in piece], **look)


def _caption(apart: dict[str, float]) -> str:
    most = ", ".join(f"{100.0 * metres:.0f} cm over {link}" for link, metres in apart.items())
    return (
        "The same sticks over five profiles of deploy/links. Lindy: the whole stack with its "
        "simulated vehicle, on virtual time. Naive peer: a model that acts on every command when "
        "it arrives, in that order, however old, holds the last one while nothing comes, and lets "
        "all its telemetry wait in one queue; link, commands, telemetry and the limits of the "
        "reference are Lindy's, and damaged messages are spared it. Depth is the reference's, from "
        "the start, positive down. Ages are the largest in each 0.1 s; no line: no command acts. "
        f"The two depths are apart by at most {most}. Over flaky (grey: the link is away) the "
        "stick is let go at 15.2 s: Lindy comes to rest by itself, the naive peer goes on until "
        "the link is back. Over congested the sticks fit and the telemetry does not: Lindy thins "
        "it out within three seconds, the naive peer's picture falls behind ever further."
    )
