"""What occurred in runs, from their folders."""
