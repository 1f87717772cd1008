"""The body: where its joints are, how heavy it is, how its legs reach, how it looks in a mirror."""
