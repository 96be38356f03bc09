"""Rounds of futures: what each simulates, who runs it, and what those who watch receive."""
