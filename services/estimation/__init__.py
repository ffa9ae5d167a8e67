"""From sensor samples to `VehicleState`: depth, attitude, two headings, horizontal motion."""
