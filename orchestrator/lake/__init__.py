"""Many runs and sweeps in one place: partitioned Parquet that any engine reads."""
