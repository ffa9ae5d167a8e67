"""Laws of the papers that never fly: the thesis' own rule, the usual filters to compare with, the
reference model of Fernandes et al. 2015, and the flying law for whole batches of states.
"""
