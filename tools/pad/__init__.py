"""`lindy pad`: what a pad sends, what its profile makes of it, and a profile of its own."""
