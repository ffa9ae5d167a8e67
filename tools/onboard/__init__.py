"""The drone's side in the field, in three programs of one process that replace each other.

`lindy up drone` checks everything and plans; `supervise` keeps the services running, for hours,
with no more in memory than that needs: no screen, no numpy; `report` sums up when it is over.
"""
