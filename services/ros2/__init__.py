"""ROS 2: what the drone measures and does as standard messages, and sticks from there, on the keys
of rmw_zenoh."""
