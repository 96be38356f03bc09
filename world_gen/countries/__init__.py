"""What holds in which country where a map does not say: outlines, and rules with their sources."""
