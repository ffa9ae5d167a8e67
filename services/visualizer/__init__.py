"""Shows a dive: every stream into a rerun recording, and into a live viewer where wanted."""
