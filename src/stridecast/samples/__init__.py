"""Takes and recordings to begin with."""
