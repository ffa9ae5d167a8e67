"""Predicts the drone's present state: propagates its reference with the commands on the link."""
