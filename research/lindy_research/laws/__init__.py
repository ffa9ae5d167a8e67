"""Laws that never fly: what Fernandes et al. 2015 print, the flying law step by step, and for whole
batches of states.
"""
