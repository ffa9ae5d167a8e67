"""The pilot's hands: a pad, the keyboard or a recorded stick log become pilot commands."""
