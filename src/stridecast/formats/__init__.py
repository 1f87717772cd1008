"""Doors to files, one file a format."""
