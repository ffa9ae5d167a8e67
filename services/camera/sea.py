"""The simulated sea, ray-cast into pictures: a floor, pilings, particles and lamp light.

A pure function of where the vehicle is. Computed in luma and chroma (BT.601, video range), as the
encoder wants it. World NED, camera axes forward, right, down.

What a surface sends back is weakened by exp(-c r) on its way r [m] to the camera, and the lamp's
light by exp(-c r) / r² before; the water between adds a veil that grows with 1 - exp(-c r). c [1/m]
is the beam attenuation: Jaffe 1990, *Computer modeling and the design of optimal underwater imaging
systems*, in its simplest form.
"""

from itertools import product
from math import acos, asin, ceil, cos, exp, floor, hypot, sin, tan
from typing import Annotated, Any, NamedTuple

import msgspec
import numpy as np
from numpy.typing import NDArray

from messages.units import Quaternion, Share, Vec3
from services.marine.attitude import dot, to_world

Floats = NDArray[np.floating[Any]]  # 32 bit: half the time of 64
Bytes = NDArray[np.uint8]
BAND = 90  # [px] rows that are computed at once: their arrays stay in the processor's cache
EVERY = slice(None)  # row or column
FARTHEST = 40.0  # [m] here the water hides everything
NEAREST = 0.2  # [m]
TILE, PX_PER_M = 1024, 100.0  # [px], [px/m] of the texture, which repeats
MEAN_ALBEDO = 0.42  # [-] of the floor
ALBEDO_STEP = np.float32(1.0 / 255.0)  # [-] of the texture
GROWTH_STEP = np.float32(0.6) * ALBEDO_STEP  # [-] a piling is darker
PILING_RADIUS = 0.22  # [m]
PILINGS_APART = (6.0, 4.0)  # [m] north, east: in rows, as under a quay
FIRST_PILING = (3.5, 2.0)  # [m] north, east
PILINGS_REACH = 12.0  # [m] further ones are not drawn
STEEP = 1.35  # [rad] of a ray: here a piling's outlines are not looked for
RING_WHITE = np.float32(0.45)  # [-] more albedo, on
RING = 0.08  # [m] width of the white ring on a piling at each metre of depth
HIDDEN = 6.0  # [-] attenuation after which less than a step of the picture is left
LAST_SEEN = 2.5  # [-] attenuation after which a thing is not worth drawing
PARTICLES, PARTICLE_BOX = 220, 4.0  # in a box of this side [m], which repeats
LAMP, LAMP_ANGLE = 9.0, 0.6  # [m²] strength, [rad] where it has fallen to 1/e
DAY_LOSS = 0.3  # [-] of the beam attenuation, per metre of depth
BACKSCATTER = 0.09  # [-] of the lamp's light, in water that lets nothing through
MOST_GAIN = 6.0  # [-] of the automatic exposure: then it is dark
METER = 32  # columns of pixels that the exposure is measured by, with the lamp on
METERED, EXPOSED = 90.0, 0.75  # [%] of the picture is no brighter than this [-]
BLACK, WHITE, GREY = 16.0, 235.0, 128.0
SAND, GROWTH = (-9.0, 7.0), (-14.0, 2.0)  # chroma (blue, red) of the floor and of a piling
WATER = (10.0, -15.0)  # of the veil


class WaterLight(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """What light there is, and what the water does to it."""

    turbidity: Annotated[float, msgspec.Meta(ge=0.02, le=5.0)] = 0.25  # [1/m] beam attenuation
    daylight: Share = 0.6  # [-] at the surface; 0 is night


class CameraView(NamedTuple):
    """Where the camera is, and its lamp."""

    position: Vec3  # [m] NED
    attitude: Quaternion  # [-] q_NB as w, x, y, z
    tilt: float = 0.0  # [rad] of the camera, + upwards
    lamp: float = 0.0  # [-] 0 … 1
    yaw: float = 0.0  # [rad] of the camera, + to starboard


class Picture(NamedTuple):
    """The planes of a picture, yuv420p: chroma has half the luma's width and height."""

    y: Bytes
    u: Bytes
    v: Bytes


class CameraAxes(NamedTuple):
    """The camera's axes, NED."""

    forward: Vec3
    right: Vec3
    down: Vec3


class Rays(NamedTuple):
    """Directions of some pixels, NED, per metre along the camera's axis."""

    north: Floats
    east: Floats
    down: Floats
    length: Floats  # [-] of each


class SeenSurfaces(NamedTuple):
    """What the rays of some pixels meet."""

    way: Floats  # [m] along each ray
    down: Floats  # [-] of each ray, per metre of it
    albedo: Floats  # [-]
    piling: NDArray[np.bool_]  # a piling; else the floor, or only water

    def part(self, *at: slice) -> "SeenSurfaces":
        """The part of it in some rows, or in some rows and columns."""
        return SeenSurfaces(self.way[at], self.down[at], self.albedo[at], self.piling[at])


class Piling(NamedTuple):
    north: float  # [m] of its axis from the camera
    east: float  # [m]
    columns: slice  # of the picture, which it may cover


class SimulatedSea:
    """Draws pictures of one size."""

    def __init__(
        self,
        width: int,
        height: int,
        angle: float,
        water: WaterLight,
        floor_depth: float,
    ) -> None:
        """
        Args:
            angle: [rad] of view, over the whole width.
            floor_depth: [m]
        """
        self._focal = width / 2.0 / tan(angle / 2.0)  # [px]
        self._width, self._height = width, height
        self._bands = [slice(top, min(top + BAND, height)) for top in range(0, height, BAND)]
        self._right = ((np.arange(width) - (width - 1) / 2.0) / self._focal).astype(np.float32)
        self._below = ((np.arange(height) - (height - 1) / 2.0) / self._focal).astype(np.float32)
        aside = np.hypot(self._right[None, :], self._below[:, None])
        self._length = np.hypot(aside, np.float32(1.0))
        self._shortening = 1.0 / self._length
        self._corner = float(np.arctan(aside.max()))  # [rad] of the widest ray
        self._beam = np.exp(-((np.arctan(aside) / LAMP_ANGLE) ** 2))
        self._water, self._floor_depth = water, floor_depth
        # Bytes: they stay in the processor's cache, which saves a sixth of the time.
        self._texture = np.rint(_texture().reshape(-1) / ALBEDO_STEP).astype(np.uint8)
        self._particles = np.random.default_rng(3).uniform(0.0, PARTICLE_BOX, (PARTICLES, 3))

    def draw(self, view: CameraView) -> Picture:
        """The picture that a camera at `view` takes."""
        axes = _axes(view)
        y = np.empty((self._height, self._width), np.uint8)
        u = np.empty((self._height // 2, self._width // 2), np.uint8)
        v = np.empty_like(u)
        seen = self._seen(view.position, axes)
        day, lamp = self._exposed(view, seen)
        for rows in self._bands:
            half = slice(rows.start // 2, rows.stop // 2)
            y[rows], u[half], v[half] = self._lit(seen.part(rows), self._beam[rows], lamp, day)
        self._snow(y, view.position, axes, lamp, day)
        return Picture(y, u, v)

    # What is seen.

    def _seen(self, position: Vec3, axes: CameraAxes) -> SeenSurfaces:
        shape = self._length.shape
        way, down, albedo = [np.empty(shape, np.float32) for _ in range(3)]
        seen = SeenSurfaces(way, down, albedo, np.zeros(shape, np.bool_))
        for rows in self._bands:
            rays = self._rays(axes, rows, EVERY)
            np.multiply(rays.down, self._shortening[rows], out=seen.down[rows])
            self._floor(seen.part(rows), position, rays)
        for piling in self._pilings(position, axes):
            self._stand(seen, position[2], self._rays(axes, EVERY, piling.columns), piling)
        return seen

    def _rays(self, axes: CameraAxes, rows: slice, columns: slice) -> Rays:
        north, east, down = (
            (axes.forward[k] + axes.right[k] * self._right[columns])[None, :]
            + (axes.down[k] * self._below[rows])[:, None]
            for k in range(3)
        )
        return Rays(north, east, down, self._length[rows, columns])

    def _floor(self, seen: SeenSurfaces, position: Vec3, rays: Rays) -> None:
        above = max(self._floor_depth - position[2], NEAREST)
        if float(rays.down.max()) * min(FARTHEST, HIDDEN / self._water.turbidity) < above:
            np.multiply(rays.length, FARTHEST, out=seen.way)
            seen.albedo.fill(MEAN_ALBEDO)
            return
        ahead = above / np.maximum(rays.down, above / FARTHEST)
        side = TILE / PX_PER_M
        x = (rays.north * ahead + position[0] % side) * PX_PER_M
        y = (rays.east * ahead + position[1] % side) * PX_PER_M
        at = (x.astype(np.int32) & (TILE - 1)) * TILE + (y.astype(np.int32) & (TILE - 1))
        np.multiply(self._texture.take(at), ALBEDO_STEP, out=seen.albedo)
        np.multiply(ahead, rays.length, out=seen.way)

    def _pilings(self, position: Vec3, axes: CameraAxes) -> list[Piling]:
        """Those in sight."""
        found: list[Piling] = []
        reach = min(PILINGS_REACH, LAST_SEEN / self._water.turbidity)
        places = (
            _places(*place) for place in zip(position, FIRST_PILING, PILINGS_APART, strict=False)
        )
        for north, east in product(*places):
            if PILING_RADIUS < hypot(north, east) < reach:
                columns = self._columns(axes, north, east)
                if columns.start < columns.stop:
                    found.append(Piling(north, east, columns))
        return found

    def _columns(self, axes: CameraAxes, north: float, east: float) -> slice:
        """Columns between the outlines of the part of a piling that is in sight; all of them where
        the camera looks too steeply up or down to tell."""
        forward, way = axes.forward, hypot(north, east)
        level = hypot(forward[0], forward[1])  # cosine of the camera's elevation
        steepest = acos(min(1.0, level)) + self._corner
        if steepest > STEEP:
            return slice(0, self._width)
        aside = acos(max(-1.0, min(1.0, (forward[0] * north + forward[1] * east) / (level * way))))
        if aside > asin(sin(self._corner) / level) + asin(PILING_RADIUS / way):
            return slice(0, 0)
        wide, tall = 1.1 * PILING_RADIUS / way, way * tan(steepest)
        ends = [
            (north - side * wide * east, east + side * wide * north, down)
            for side, down in product((-1.0, 1.0), (-tall, tall))
        ]
        ahead = [dot(forward, end) for end in ends]
        if min(ahead) < 0.05 * way:
            return slice(0, self._width)
        pixels = [
            self._width / 2.0 + self._focal * dot(axes.right, end) / far
            for end, far in zip(ends, ahead, strict=True)
        ]
        least, most = floor(min(pixels)), ceil(max(pixels)) + 1
        return slice(max(0, min(least, self._width)), max(0, min(most, self._width)))

    def _stand(self, seen: SeenSurfaces, depth: float, rays: Rays, piling: Piling) -> None:
        """A piling where it is nearer than what was seen so far."""
        at = (EVERY, piling.columns)
        north, east = rays.north, rays.east
        across = north * north + east * east
        towards = north * piling.north + east * piling.east
        outside = piling.north**2 + piling.east**2 - PILING_RADIUS**2
        found = towards * towards - across * outside
        ahead = (towards - np.sqrt(np.maximum(found, 0.0))) / np.maximum(across, 1e-9)
        way = ahead * rays.length
        hit = (found > 0.0) & (ahead > NEAREST) & (way < seen.way[at])
        if not hit.any():
            return
        ahead = ahead[hit]
        down = depth + rays.down[hit] * ahead
        x = ((north[hit] * ahead - piling.north) * (5.0 * PX_PER_M)).astype(np.int32) & (TILE - 1)
        y = (down * PX_PER_M).astype(np.int32) & (TILE - 1)
        ring = np.abs(down - np.rint(down)) < RING / 2.0
        seen.way[at][hit] = way[hit]
        seen.albedo[at][hit] = GROWTH_STEP * self._texture.take(x * TILE + y) + RING_WHITE * ring
        seen.piling[at][hit] = True

    # How it looks.

    def _exposed(self, view: CameraView, seen: SeenSurfaces) -> tuple[float, float]:
        """[-] Daylight left at this depth, and the lamp, as a camera with automatic exposure takes
        them: near things are not made all white by the lamp."""
        water = self._water
        day = water.daylight * exp(-DAY_LOSS * water.turbidity * max(0.0, view.position[2]))
        gain = min(MOST_GAIN, 1.0 / max(day + 0.3 * view.lamp, 1e-6))
        if view.lamp > 0.0:
            apart = max(1, self._width // METER)
            coarse = slice(apart // 2, None, apart)
            beam = self._beam[coarse, coarse]
            luma, _ = self._luma(seen.part(coarse, coarse), beam, gain * view.lamp, gain * day)
            bright = float(np.percentile(luma, METERED))  # 1 is white
            gain *= min(1.0, EXPOSED / max(bright, 1e-6))
        return gain * day, gain * view.lamp

    def _luma(
        self, seen: SeenSurfaces, beam: Floats, lamp: float, day: float
    ) -> tuple[Floats, Floats]:
        """[-] Light, 1 is white, and the share that the water lets through. Twice as much lamp and
        daylight is twice the light."""
        through = np.exp(-self._water.turbidity * seen.way)
        veil = 0.45 * day - (0.25 * day) * seen.down
        light = np.float32(day)
        if lamp > 0.0:
            veil += (lamp * BACKSCATTER) * beam
            light = day + (lamp * LAMP) * beam * through / np.maximum(seen.way * seen.way, 0.3)
        luma = seen.albedo * light
        luma -= veil
        luma *= through
        luma += veil
        return luma, through

    def _lit(
        self, seen: SeenSurfaces, beam: Floats, lamp: float, day: float
    ) -> tuple[Bytes, Bytes, Bytes]:
        luma, through = self._luma(seen, beam, lamp, day)
        np.minimum(luma, 1.0, out=luma)
        clear = through[::2, ::2]
        shade = np.minimum(2.0 * luma[::2, ::2], 1.0)
        stands = seen.piling[::2, ::2].astype(np.float32)
        blue, red = (
            GREY + shade * (clear * (sand + (growth - sand) * stands) + (1.0 - clear) * water)
            for growth, sand, water in zip(GROWTH, SAND, WATER, strict=True)
        )
        luma *= WHITE - BLACK
        luma += BLACK
        return luma.astype(np.uint8), blue.astype(np.uint8), red.astype(np.uint8)

    def _snow(self, y: Bytes, position: Vec3, axes: CameraAxes, lamp: float, day: float) -> None:
        """Particles that stand still in the water, so that they pass by."""
        offset = self._particles - np.array(position)
        offset = (offset + PARTICLE_BOX / 2) % PARTICLE_BOX - PARTICLE_BOX / 2
        right, down, ahead = (offset @ np.array(axis) for axis in (axes.right, axes.down, axes[0]))
        seen = ahead > NEAREST
        column = (self._width / 2 + self._focal * right[seen] / ahead[seen]).astype(np.int64)
        row = (self._height / 2 + self._focal * down[seen] / ahead[seen]).astype(np.int64)
        way = np.sqrt((offset[seen] ** 2).sum(axis=1))
        inside = (column >= 0) & (column < self._width - 1) & (row >= 0) & (row < self._height - 1)
        column, row, way = column[inside], row[inside], way[inside]
        through = np.exp(-self._water.turbidity * way)
        shine = 0.4 * day + 0.5 * lamp * self._beam[row, column] / np.maximum(way**2, 0.5)
        light = BLACK + (WHITE - BLACK) * np.minimum(1.0, shine * through)
        for below, aside in ((0, 0), (0, 1), (1, 0), (1, 1)):
            large = way < (PARTICLE_BOX if below == aside == 0 else 0.8)
            at = row[large] + below, column[large] + aside
            y[at] = np.maximum(y[at], light[large].astype(np.uint8))


def _axes(view: CameraView) -> CameraAxes:
    c, s = cos(view.tilt), sin(view.tilt)
    ahead, aside = cos(view.yaw), sin(view.yaw)
    body = (c * ahead, c * aside, -s), (-aside, ahead, 0.0), (s * ahead, s * aside, c)
    return CameraAxes(*(to_world(view.attitude, axis) for axis in body))


def _places(position: float, first: float, apart: float) -> list[float]:
    """[m] from the camera, along one direction, of all rows of pilings that may be in sight."""
    least = ceil((position - PILINGS_REACH - first) / apart)
    most = floor((position + PILINGS_REACH - first) / apart)
    return [first + number * apart - position for number in range(least, most + 1)]


def _texture() -> Floats:
    """Albedo [-] of sand with ripples, patches and stones; it repeats without a seam."""
    rng = np.random.default_rng(7)
    waves = np.fft.rfft2(rng.standard_normal((TILE, TILE)))
    k = np.hypot(np.fft.fftfreq(TILE)[:, None], np.fft.rfftfreq(TILE)[None, :])
    patches = _scaled(np.fft.irfft2(waves / (k + 0.004) ** 1.6))
    grain = _scaled(np.fft.irfft2(waves * np.exp(-((k / 0.12) ** 2))))
    stones = _scaled(np.fft.irfft2(np.fft.rfft2(rng.standard_normal((TILE, TILE)))
                                   * np.exp(-((k / 0.02) ** 2))))  # fmt: skip
    x = np.arange(TILE) * (2.0 * np.pi * 40 / TILE)
    ripples = np.sin(x[:, None] + 2.2 * patches)
    albedo = MEAN_ALBEDO + 0.07 * patches + 0.05 * ripples + 0.04 * grain
    albedo = np.where(stones > 2.1, 0.16 + 0.04 * grain, albedo)
    return np.clip(albedo, 0.05, 0.9).astype(np.float32)


def _scaled(values: NDArray[np.float64]) -> NDArray[np.float64]:
    return (values - values.mean()) / values.std()
