"""Frozen nouns; no algorithms."""
