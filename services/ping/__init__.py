"""An echo sounder Ping1D of Blue Robotics that looks down: the altitude above the bottom."""
