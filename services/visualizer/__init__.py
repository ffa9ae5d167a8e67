"""Shows a dive: writes every topic to a rerun recording, and to a live viewer where wanted."""
