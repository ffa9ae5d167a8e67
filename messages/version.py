"""Lindy's version, as in pyproject.toml. Asking the installed package for it takes a process up
to 2 MB and 20 ms."""

VERSION = "0.1.0"
