"""The drone's camera: pictures from a device, the network, a file or the simulated sea, as H.264 at
the bitrate that the link has room for."""
