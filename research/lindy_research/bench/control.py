"""What the controller is worth: on a plant that is known exactly, and in the whole chain with
real estimates."""

from lindy_research.bench import control_loop, control_plant
from lindy_research.bench.table import Figure


def figures() -> list[Figure]:
    return [*control_plant.figures(), *control_loop.figures()]
