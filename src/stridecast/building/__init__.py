"""Recordings to a motion database: many files, all cores, and what was done before is not done again."""
