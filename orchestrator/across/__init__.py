"""Many runs, sweeps and lakes at once: listed, asked by SQL, and two of them compared."""
