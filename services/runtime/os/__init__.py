"""What operating systems do not have in common: in `system`, and nowhere else.

The lowest room of the runtime. The tools and what is in an io/ import it, too.
"""
