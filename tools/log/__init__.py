"""What the verbs of `lindy log` do with a recording: look into it, check it, cut it, mend it, turn it
into tables or a stick log, and compare it with another."""
