"""Reading recordings back: messages of a dive in order, stretches at rest, Allan deviation."""
