"""Andrén 2023, Tables 6.1 and 6.2 beside our own numbers."""

from functools import partial

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from lindy_research.papers import style
from lindy_research.papers.identified_inputs import STEP_ON
from lindy_research.papers.identified_plant import END_JERK, Sums, ratios, rise_time, sums
from lindy_research.papers.identified_runs import NAIVE, Stick, equal_rise_jerk, expected_sums, run

# As printed: naive, minimum jerk.
PRINTED: dict[Stick, tuple[Sums, Sums]] = {
    "step": (Sums(8.91, 2.16, 6554, 1643461), Sums(4.88, 0.14, 3669, 11728)),
    "log": (Sums(6.24, 5.57, 14814, 2389915), Sums(4.41, 0.51, 6987, 62596)),
}
ROWS = ("peak thrust\n[N]", "position error\n[m²]", "thrust\n[N²]", "jerk of thrust\n[N²/s²]")
LOOKS: tuple[style.Look, ...] = (
    {"color": style.PAPER, "marker": "o", "markersize": 8},
    {"color": style.LINDY, "marker": "o", "markersize": 14, "fillstyle": "none"},
    {"color": style.DIRECT, "marker": "D", "markersize": 6},
)


def table(figure: Figure, stick: Stick) -> str:
    jerks = (END_JERK, equal_rise_jerk())
    naive, jerky, quick = (expected_sums(jerk, stick) for jerk in (NAIVE, *jerks))
    columns = (
        ("thesis", *PRINTED[stick]),
        ("ours", naive, jerky),
        ("ours, equal rise time", naive, quick),
    )
    panel = figure.add_subplot(figure.add_gridspec(1, 2, width_ratios=(1.0, 1.15))[0, 0])
    for place, (name, without, by) in enumerate(columns):
        found = ratios(without, by)
        panel.plot(found, range(4), linestyle="none", label=name, zorder=3, **LOOKS[place])
        _numbers(panel, place, name, without, by)
    for row in range(4):
        panel.axhline(row, color="#EEEEEE", linewidth=7, zorder=0)
    panel.axvline(1.0, **style.EDGE)
    panel.set(
        xscale="log",
        xlim=(0.7, 220.0), xlabel="naive / minimum jerk [-]", ylim=(3.6, -0.9),
        yticks=range(4), yticklabels=ROWS, ylabel="peak and sums of squares [unit]",
    )  # fmt: skip
    ticks = [1, 2, 5, 10, 20, 50, 100]
    panel.set_xticks(ticks, [str(tick) for tick in ticks])
    panel.minorticks_off()
    panel.legend(ncols=3, loc="lower left", bbox_to_anchor=(0.0, 1.0), borderaxespad=0.1)
    return _caption(stick)


def _numbers(panel: Axes, place: int, name: str, without: Sums, by: Sums) -> None:
    """A column of the table beside the chart: naive, minimum jerk, and their ratio."""
    at = 1.25 + 0.5 * place  # [widths of the chart]
    look: style.Look = {
        "transform": panel.get_yaxis_transform(),
        "ha": "center",
        "in_layout": False,
    }
    panel.text(at, -0.62, name, fontweight="bold", fontsize=8.5, **look)
    for row, (a, b) in enumerate(zip(without, by, strict=True)):
        text = f"{_short(a)}\n{_short(b)}\n= {a / b:.3g} : 1"
        panel.text(at, row, text, va="center", fontsize=8.5, **look)


def _short(value: float) -> str:
    return f"{value:,.0f}" if value >= 100 else f"{value:.2f}"


def _caption(stick: Stick) -> str:
    both = (
        "Numbers: naive, minimum jerk, and their ratio, which the chart shows. Ours on average "
        "over random force noise. "
    )
    rise = [rise_time(run(jerk, disturbed=False), STEP_ON) for jerk in (NAIVE, END_JERK)]
    if stick == "log":
        return (
            f"{both}The thesis' log is not printed; ours is chosen from many random ones because "
            f"it fits. At an end jerk of {equal_rise_jerk():.2f} m/s³, which is as quick as the "
            "naive reference, only position error and jerk are lower: what saves thrust is going "
            "slowly."
        )
    sine = [sums(run(jerk)) for jerk in (NAIVE, END_JERK)]
    found = ", ".join(f"{ratio:.3g}" for ratio in ratios(*sine))
    return (
        f"{both}With a disturbance of three sines the ratios are {found}. The thesis compares a "
        f"rise of {rise[1]:.2f} s with one of {rise[0]:.2f} s. At equal rise time (end jerk "
        f"{equal_rise_jerk():.2f} m/s³) peak and thrust are those of the naive reference; what "
        "minimum jerk gives is a small position error and little jerk."
    )


of_the_step = partial(table, stick="step")
of_the_log = partial(table, stick="log")
