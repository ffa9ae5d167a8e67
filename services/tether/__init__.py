"""The only way across: carries the table's DOWN and UP rows between the two realms."""
