"""What a run leaves behind: counts, tables, its record, and what the engineer reads of it."""
