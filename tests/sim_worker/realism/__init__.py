"""How alike simulated road users and recorded ones are, in distributions with units."""
