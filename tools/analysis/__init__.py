"""What a recorded dive says, question by question: columns in, figures out. Shared by
the report and the review."""
