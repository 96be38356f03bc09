"""What the driving software planned beside what the human driver did instead."""
