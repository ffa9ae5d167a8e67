"""What flows: msgspec Structs and the table of streams. No Zenoh, no NumPy."""
