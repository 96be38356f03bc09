"""Other road users of a future: where they drive and when."""
