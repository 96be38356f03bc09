"""The gap between the real vehicle and its model, by horizon and manoeuvre, and its cause."""
