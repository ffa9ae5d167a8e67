"""Flies a recorded pilot on virtual time, and says how well the depth was held.

python examples/library/virtual_dive.py [SEED]
"""

import sys

import numpy as np

from lindy.api.dives import Registry, Stack, VirtualHost
from lindy.api.messages import VehicleState, topics

SECONDS = 30
FILES = ("recorder", "visualizer")  # services that write files


def main(seed: int) -> None:
    stack = Stack(pilot="script:first_dive", seed=seed, virtual=True)
    services = Registry.read()
    host = VirtualHost()
    watch = host.node("watch", ["drone"])  # no service: it only listens
    wanted, errors = watch.latest(topics.REFERENCE), list[float]()

    def on_state(state: VehicleState, now: int) -> None:
        reference = wanted.fresh(now)
        if reference is not None and reference.armed:
            errors.append(state.depth.value - reference.depth.position)

    watch.each(topics.STATE, on_state)
    host.add_all(services.only({n: s for n, s in services.items() if n not in FILES}), stack)
    host.run(SECONDS * 1_000_000_000)
    rms, worst = np.sqrt(np.mean(np.square(errors))), np.abs(errors).max()
    print(
        f"depth error of {len(errors)} states: rms {100 * rms:.1f} cm, worst {100 * worst:.1f} cm"
    )


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 0)
