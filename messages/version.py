"""Lindy's version, as in pyproject.toml. Asking the installed package for it takes each process
4 MB and 20 ms."""

VERSION = "0.1.0"
