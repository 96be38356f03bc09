"""The vehicle's parameters in a drive: what counts, what the driving says, who has been told."""
