"""The one place that knows Zenoh, the clock and the operating system.

`Node` is what a service holds. `process_host` runs one service, or several of one side, as an OS
process on wall time; `virtual_host` runs any set of services in one process on virtual time. A
lockstep host (many processes, virtual time) will be the third and needs nothing from a service that
these two do not.
"""
