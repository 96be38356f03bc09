"""Other physics than MuJoCo's for the same job, behind one protocol."""
