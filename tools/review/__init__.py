"""`lindy review`: one page about a dive, of any vehicle that logs."""
