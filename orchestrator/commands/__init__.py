"""The command line, and the body of each command."""
