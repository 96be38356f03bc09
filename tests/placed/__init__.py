"""Whether what is called placed can be played: measured on maps, judged from their raw data."""
