"""`lindy import`: a log that another program wrote becomes a recording. `command` is the verb, each
*_file reads a format, `conversion` makes messages of what it reads by the map of `map_file`."""
