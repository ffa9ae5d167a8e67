"""What operating systems do not have in common: in `system`, and nowhere else.

The lowest room of the runtime. The tools and what is in an io/ import it, too.
"""

# Allocations between two searches for garbage, of three generations; Python's are 700, 10, 10.
# What is imported stays, and to search it takes a sixth of a start, and again at the end.
RARE_SEARCHES = (20_000, 20, 50)
