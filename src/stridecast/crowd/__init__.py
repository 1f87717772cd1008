"""Who is in a crowd and where."""
