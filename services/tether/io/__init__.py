"""Link profiles and traces on disk."""
