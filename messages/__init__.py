"""What flows: message types (msgspec Structs) and the table of topics. No Zenoh, no NumPy."""
