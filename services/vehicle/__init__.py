"""Shared by all vehicle interfaces, simulator or driver. Pure: no bus, no clock.

    actuator_gate   which thruster commands take effect, and for how long; the pilot's disarm,
                    obeyed by each stage itself
    actuation       newtons to a share of the voltage, and a model of open-loop thrusters
    mounting        position and orientation of the sensors

A vehicle interface publishes the sensor topics of messages/topics.py that it has, among them
`sensor/battery`, `sensor/leak` and `sensor/temperature`, by which the failsafes judge
(docs/failsafes.md), and `vehicle/actuation`. It subscribes to:

- `control/thrusters`, through an `ActuatorGate`. A force for each thruster, for a short time.
- `pilot/request`, for the same gate: a disarm is obeyed here, too, even if the services above hang.
- `vehicle/status`, whose `outputs` are lights and switches, and
- `reference`, whose `tilt.position` [rad] is the camera tilt.

Lights and tilt can do no harm, so they have no time-to-live: without messages both keep their last
value, and a pilot who lost the link keeps the light. A gripper ends with its command, and what has
an `off_after` with the status: `driven` of services/marine/outputs.py says both. Read them with
`node.latest(...).newest(now)`, which is the last value at any age; never read thrust that way.

Failures:

- A service above the driver dies or hangs: the commands end with their time-to-live, the gate's
  output is zero from that instant, and the driver continues to publish its sensors.
- The driver dies: the supervisor restarts it. Until then nothing writes to the thrusters, so the
  board below must stop them: the time-out of the ESC or of the autopilot board is the last
  protection. Never disable it, and keep it below a second.
- `armed` in a command is the pilot's permission for thrusters to turn. Armed with zero thrust is
  not the same as disarmed: initialise and hold ESCs while armed, cut their signal when disarmed.

A driver publishes raw samples, in the sensor's own axes and position; [vehicle.mounting] describes
both, and estimation transforms the samples (docs/decisions.md, 0012).
"""
