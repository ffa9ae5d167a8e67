"""What every vehicle side shares, whether it is a simulator or a driver. Pure: no bus, no clock.

    actuator_gate   which thruster commands act, and for how long
    actuation       newtons to a share of the voltage, and what an open-loop thruster is believed to
                    do
    mounting        where a sensor sits and how it is turned

A vehicle side says the sensor rows of messages/topics.py that it has, `vehicle/actuation` and
`sensor/battery`, and hears:

- `control/thrusters`, through an `ActuatorGate`. A force for each thruster, for a short time.
- `vehicle/status`, whose `light` (0 … 1) is the brightness of the lamps, and
- `reference`, whose `tilt.position` [rad] is where the camera looks.

Light and tilt move nothing that could do harm, so they have no time-to-live: on silence both keep
their last value, and a pilot who lost the link does not lose the light too. Read them with
`node.latest(...).newest(now)`, which is the last value however old; thrust never.

Who guards whom:

- What is above the driver dies or hangs: the commands end by their time-to-live, the gate says zero
  at that very instant, and the driver goes on saying what its sensors measure.
- The driver dies: the supervisor starts it again. Until then nobody writes to the thrusters, so
  the board under it must stop them by itself: the time-out of the ESC or of the autopilot board is
  the last floor. Never switch it off, and keep it below a second.
- `armed` in a command is the pilot's word that thrusters may turn. Armed with zero thrust is not
  the same as disarmed: initialise and hold ESCs while armed, cut their signal when disarmed.

A driver says what the sensor says, in the sensor's own axes, where the sensor sits; the table
[vehicle.mounting] says where that is, and estimation puts it right (docs/decisions/0012).
"""
