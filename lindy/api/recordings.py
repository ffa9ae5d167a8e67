"""To read what a dive recorded: typed messages, in the order of their arrival."""

from tools.recordings.recording import Raw, RecordedMessage, Recording, log_hash, open_recording

__all__ = ["Raw", "RecordedMessage", "Recording", "log_hash", "open_recording"]
