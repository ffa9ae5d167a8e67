"""Forces on the vessel other than those of open water: sea floor, walls, tether."""

from messages.units import Quaternion, Vec3, Vec6
from services.marine.attitude import to_body, to_world
from services.marine.summation import plain_sum
from services.marine.water import density_of
from services.simulator.barrier import Barrier
from services.simulator.settings import Settings
from services.simulator.tether import Tether

NORTH, EAST, DOWN = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)


class Surroundings:
    def __init__(self, place: Settings, hull_size: Vec3, inertia: float) -> None:
        """
        Args:
            hull_size: [m] length, width, height.
            inertia: [kg] of the vehicle with added mass, in heave.
        """
        self.tether: Tether | None = None
        if place.tether is not None:
            self.tether = Tether(place.tether, density_of(place.water_density))
        sides: list[tuple[Vec3, float]] = [(DOWN, place.floor_depth)]
        if (walls := place.walls) is not None:
            sides += [(NORTH, walls.north[1]), (_minus(NORTH), -walls.north[0])]
            sides += [(EAST, walls.east[1]), (_minus(EAST), -walls.east[0])]
        self._sides = [(way, Barrier(limit, hull_size, inertia)) for way, limit in sides]
        self._open_above = place.floor_depth - plain_sum(hull_size)  # [m] far from the floor
        self._open_sideways = walls is None

    def near(self, position: Vec3) -> list[tuple[Vec3, Barrier]]:
        """Barriers that the hull may touch, with the direction [-] NED that leads into each."""
        if position[2] < self._open_above and self._open_sideways:
            return []
        return [
            (way, barrier) for way, barrier in self._sides if barrier.near(_along(way, position))
        ]

    def floor_felt(self, position: Vec3, q_NB: Quaternion) -> bool:
        """Whether the hull touches the floor."""
        _, floor = self._sides[0]
        depth = position[2]
        return floor.near(depth) and floor.touches(depth, to_body(q_NB, DOWN))

    def push(
        self, barriers: list[tuple[Vec3, Barrier]], position: Vec3, q_NB: Quaternion, nu: Vec6
    ) -> list[Vec6]:
        """Wrenches [N, N m] of these barriers, for a velocity over the ground in body axes."""
        return [
            barrier.push(_along(way, position), to_body(q_NB, way), nu) for way, barrier in barriers
        ]

    def pull(self, depth: float, q_NB: Quaternion, nu: Vec6) -> Vec6:
        """Wrench [N, N m] of the tether, for a velocity through the water in body axes."""
        return *to_body(q_NB, self.tether_pull(depth, q_NB, nu)), 0.0, 0.0, 0.0

    def tether_pull(self, depth: float, q_NB: Quaternion, nu: Vec6) -> Vec3:
        """[N] NED, for a velocity through the water in body axes; none without a tether."""
        if self.tether is None:
            return (0.0, 0.0, 0.0)
        u, v, w, *_ = nu
        return self.tether.pull(depth, to_world(q_NB, (u, v, w)))


def _along(way: Vec3, position: Vec3) -> float:
    return way[0] * position[0] + way[1] * position[1] + way[2] * position[2]


def _minus(v: Vec3) -> Vec3:
    return -v[0], -v[1], -v[2]
