"""Two real drives of one road against each other: how people differ where nothing is wrong."""
