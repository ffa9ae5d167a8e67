"""A stick that jumps, and the reference made of it. Writes a plot.

python examples/library/ramp_plot.py ramp.png
"""

import sys
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from lindy.api.references import Limits, Ramp

LIMITS = Limits(jerk=1.5, acceleration=0.5)  # [m/s³], [m/s²]
STICK = {0.5: 0.5, 2.5: -0.2, 3.0: 0.0}  # from this time [s] on, this velocity is wanted [m/s]
DT, END = 0.01, 6.0  # [s]


def main() -> None:
    out = Path(sys.argv[1] if len(sys.argv) > 1 else "ramp.png")
    if out.exists():
        sys.exit(f"{out} exists already; name another file")
    ramp, due, rows = Ramp(LIMITS), sorted(STICK.items()), list[tuple[float, ...]]()
    for t in np.arange(0.0, END, DT).tolist():
        while due and due[0][0] <= t:
            time, wanted = due.pop(0)
            ramp.aim(wanted, time)  # at its own time, not at the next sample's
        rows.append((t, *ramp.at(t)))
    t, *curves = np.array(rows).T
    figure = Figure(figsize=(7, 8), layout="constrained")
    names = ("position [m]", "velocity [m/s]", "acceleration [m/s²]", "jerk [m/s³]")
    for axes, name, curve in zip(figure.subplots(4, sharex=True), names, curves, strict=True):
        axes.plot(t, curve)
        axes.set_ylabel(name)
    figure.savefig(out)
    most = [float(abs(curve).max()) for curve in curves[1:]]
    print("most velocity {:.3f} m/s, acceleration {:.3f} m/s², jerk {:.3f} m/s³".format(*most))


if __name__ == "__main__":
    main()
