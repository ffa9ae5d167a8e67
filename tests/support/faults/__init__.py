"""The fault matrix: every fault in every mode, flown and measured. The cells are kept as
`research/measurements/faults.csv`, and `docs/faults.md` sums them up.

The faults are data (`catalogue`), the modes too (`modes`). A cell is one fault in one mode
(`cells`), on virtual time (`virtual_dive`). It leaves observations, from which `figures` are
computed and judged by `goals`.
"""
