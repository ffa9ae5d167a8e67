"""What the numbers of a vector are called, as each message says it: for tables and plots.

Columns of a table, and the fields that other programs plot, are named by these words.
"""

X_Y_Z = ("x", "y", "z")  # a sensor's own axes; FRD, unless the vehicle file mounts it otherwise
NED = ("north", "east", "down")
QUATERNION = ("w", "x", "y", "z")
SURGE_SWAY_HEAVE = ("surge", "sway", "heave")
ROLL_PITCH_YAW = ("roll", "pitch", "yaw")
WRENCH = SURGE_SWAY_HEAVE + ROLL_PITCH_YAW

# By message type and field. A thrust has one number per thruster, in the order of the vehicle file.
COMPONENTS: dict[str, dict[str, tuple[str, ...]]] = {
    "ImuSample": {"specific_force": X_Y_Z, "angular_rate": X_Y_Z},
    "MagnetometerSample": {"field": X_Y_Z},
    "DvlSample": {"velocity": X_Y_Z},
    "VehicleState": {"attitude": QUATERNION},
    "Wrench": {"wanted": WRENCH, "achieved": WRENCH, "disturbance": WRENCH},
    "VehicleEstimate": {"angular_rate": ROLL_PITCH_YAW},
    "VehicleStatus": {"goal": NED[:2]},
    "Truth": {
        "position": NED,
        "attitude": QUATERNION,
        "velocity": SURGE_SWAY_HEAVE,
        "angular_rate": ROLL_PITCH_YAW,
        "current": NED,
        "tether_pull": NED,
    },
}
