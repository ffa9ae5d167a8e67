"""The H.264 decoder, by FFmpeg through PyAV."""
