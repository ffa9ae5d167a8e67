"""The H.264 decoder and the encoder of JPEG, by PyAV and Pillow."""
