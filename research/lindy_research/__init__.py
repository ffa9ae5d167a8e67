"""The papers and the benchmarks: figures, claims, laws that never fly. A package of its own, which
nothing of Lindy imports; `lindy figures` and `lindy bench` find it where it is installed.
"""
