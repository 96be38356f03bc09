"""Worlds against the truth: HD maps and real tracks that no World was made from."""
