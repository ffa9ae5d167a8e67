"""The `lindy` command, one module per verb. Never imported by services."""
