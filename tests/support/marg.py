"""The plain filter that the two headings are compared with: Madgwick's filter for gyroscope,
accelerometer and magnetometer (Madgwick 2010, section 3.3), which follows whatever the compass
says. Body FRD, world NED."""

from math import sqrt

from messages.units import Quaternion, Vec3
from services.marine.attitude import down_in_body, normalised, to_world


def step(q: Quaternion, rate: Vec3, force: Vec3, field: Vec3, beta: float, dt: float) -> Quaternion:
    """q_NB after `dt` [s] with the angular rate [rad/s], the specific force and the magnetic field
    (any unit), FRD; `beta` [rad/s] is the filter's gain (Madgwick 2010, eq. 29 to 34 and 45, 46:
    north is where the field shows now, so it pulls on the heading alone)."""
    down = _scaled(force, -1.0)
    m = _scaled(field, 1.0)
    north, east, _ = to_world(q, m)
    bx = sqrt(north * north + east * east)
    dx, dy, dz = down_in_body(q)
    bz = dx * m[0] + dy * m[1] + dz * m[2]
    w, x, y, z = q
    ex, ey, ez = dx - down[0], dy - down[1], dz - down[2]
    # bx times the world's north plus bz times its down, in the body, against what was measured.
    fx = bx * (1 - 2 * (y * y + z * z)) + bz * dx - m[0]
    fy = bx * 2 * (x * y - w * z) + bz * dy - m[1]
    fz = bx * 2 * (x * z + w * y) + bz * dz - m[2]
    ax, ay, az = ex + bz * fx, ey + bz * fy, ez + bz * fz  # both pull along the down axis
    gw = 2 * (x * ay - y * ax + bx * (y * fz - z * fy))
    gx = 2 * (z * ax + w * ay - 2 * x * az + bx * (y * fy + z * fz))
    gy = 2 * (z * ay - w * ax - 2 * y * az + bx * (x * fy + w * fz - 2 * y * fx))
    gz = 2 * (x * ax + y * ay + bx * (x * fz - w * fy - 2 * z * fx))
    slope = sqrt(gw * gw + gx * gx + gy * gy + gz * gz)
    tw, tx, ty, tz = turned_raw(q, rate, dt)
    if slope > 0.0:
        k = beta * dt / slope
        tw, tx, ty, tz = tw - k * gw, tx - k * gx, ty - k * gy, tz - k * gz
    return normalised((tw, tx, ty, tz))


def turned_raw(q: Quaternion, rate: Vec3, dt: float) -> Quaternion:
    """q + dt dq/dt, not yet a unit (Madgwick 2010, eq. 12)."""
    w, x, y, z = q
    a, b, c = (0.5 * dt * r for r in rate)
    return (
        w - x * a - y * b - z * c,
        x + w * a + y * c - z * b,
        y + w * b - x * c + z * a,
        z + w * c + x * b - y * a,
    )


def _scaled(v: Vec3, sign: float) -> Vec3:
    size = sign * sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2])
    return v[0] / size, v[1] / size, v[2] / size
