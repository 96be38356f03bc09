"""What a World is made of, and how sure each part of it is."""
