"""Topside: how old the drone's picture is when it is whole, stage by stage, and what the link
lets through of it."""
