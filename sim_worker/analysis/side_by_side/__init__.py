"""What the driving software planned beside what the human who drove did instead."""
