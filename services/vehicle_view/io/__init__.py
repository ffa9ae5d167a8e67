"""The ports of a screen."""
