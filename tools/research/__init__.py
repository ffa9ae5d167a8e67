"""The papers and the benchmarks: figures, claims, laws that never fly. Not in the installed
package. Nothing on board imports from here; only the verbs `figures`, `bench` and `profile` come
in.
"""
