"""Who plays jobs: one state machine that gives them to workers, and worker processes over Zenoh."""
