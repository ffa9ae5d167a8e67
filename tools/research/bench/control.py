"""What the controller is worth: on a plant that is known exactly, and in the whole chain with
real estimates."""

from tools.research.bench import control_goals, control_loop, control_plant
from tools.research.bench.table import Figure


def figures() -> list[Figure]:
    return [*control_plant.figures(), *control_goals.figures(), *control_loop.figures()]
