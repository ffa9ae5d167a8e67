"""What the verbs of `lindy log` do with a recording: look into it, check, cut, mend, convert it, or
compare it with another."""
