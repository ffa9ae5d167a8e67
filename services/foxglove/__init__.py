"""Foxglove: shows a dive live in Foxglove or Lichtblick, and can command nothing."""
