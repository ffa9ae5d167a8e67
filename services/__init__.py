"""What runs: one folder per process, plus `runtime` (the shell) and `marine` (shared physics)."""
