"""What a user sets: stack files, vehicle files, `--set`; and the errors a user reads.
The lowest room of the runtime: imports none of the others. Services and tools import it.
"""
