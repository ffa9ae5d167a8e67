"""Reading recordings: messages of a dive in order, periods at rest, Allan deviation."""
