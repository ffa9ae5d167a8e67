"""Paths of straight lines and symmetric turns (Fernandes et al. 2015), and motion along them."""
