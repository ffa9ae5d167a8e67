"""Keys and certificates: who may reach the other machine, and as what."""
