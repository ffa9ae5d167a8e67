"""Cameras and files that give pictures, and the H.264 encoder, by FFmpeg through PyAV."""
