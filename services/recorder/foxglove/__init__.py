"""What Foxglove and Lichtblick show of a dive beyond plain values: a 3-D scene, a log and plots
with named fields. Recorded beside the messages, and sent live by the service `foxglove`."""
