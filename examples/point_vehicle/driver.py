"""A vehicle side of its own: sensors out, thruster commands in. The hardware is pretended."""

import msgspec
from pretend_hardware import Hardware

from lindy.api.messages import (
    Actuation,
    BatterySample,
    ImuSample,
    MagnetometerSample,
    PilotRequest,
    PressureSample,
    ThrusterCommand,
    topics,
)
from lindy.api.service import ActuatorGate, Node, OpenLoopThrust, Stack
from lindy.api.vehicle import Vehicle

VOLTAGE = 16.0  # [V]


class Settings(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The table of the vehicle file that has this service's name. A real one has a port here."""

    noise: float = 1.0  # [-] times that of usual sensors


def wire(node: Node, stack: Stack) -> None:
    vehicle, settings = stack.section("vehicle", Vehicle), stack.section(node.name, Settings)
    hardware = Hardware(vehicle, settings.noise, stack.seed)
    gate = ActuatorGate(vehicle.thruster, node.outbox)  # counts what it refuses
    believed = OpenLoopThrust(vehicle.thruster)
    magnetometer, imu = node.publisher(topics.MAGNETOMETER), node.publisher(topics.IMU)
    pressure, battery = node.publisher(topics.PRESSURE), node.publisher(topics.BATTERY)
    actuation = node.publisher(topics.ACTUATION)

    def obey(command: ThrusterCommand, now: int) -> None:
        gate.obey(command, now)
        write(now)

    def hear(request: PilotRequest, now: int) -> None:
        """A disarm is obeyed here too, whatever becomes of the services above."""
        gate.hear(request, now)
        write(now)

    def write(now: int) -> None:
        """To the ESCs: at each command or disarm, and at the very instant after a command's end."""
        gate.lapse(now)
        hardware.write_escs(gate.output(now), now)
        believed.drive(gate.output(now), now)
        end.set(None if gate.ends_ns is None else gate.ends_ns + 1)

    def measure_motion(now: int) -> None:
        hardware.move(now)
        magnetometer.put(MagnetometerSample(stamp_ns=now, field=hardware.field()))
        force, rate = hardware.specific_force(), hardware.angular_rate()
        imu.put(ImuSample(stamp_ns=now, specific_force=force, angular_rate=rate))
        cause = gate.command
        actuation.put(
            Actuation(
                stamp_ns=now,
                thrust=believed.believed(now),
                measured=False,
                actuated_ns=gate.obeyed_ns,
                sensor_ns=cause.sensor_ns if cause else None,
                pilot_ns=cause.pilot_ns if cause else None,
                stale=gate.ends_ns is None,
                power=hardware.power(),
            )
        )

    def measure_pressure(now: int) -> None:
        pressure.put(PressureSample(stamp_ns=now, pressure=hardware.pressure()))

    def measure_battery(now: int) -> None:
        current = hardware.power() / VOLTAGE
        battery.put(BatterySample(stamp_ns=now, voltage=VOLTAGE, current=current, used_wh=0.0))

    end = node.alarm(write)
    node.each(topics.THRUSTERS, obey)
    node.each(topics.PILOT_REQUEST, hear)
    node.every(topics.IMU.hz, measure_motion)
    node.every(topics.PRESSURE.hz, measure_pressure)
    node.every(topics.BATTERY.hz, measure_battery)
