"""Whether simulation and reality agree on pass or fail, and how large a gap flips the answer."""
