"""Scene and behavior to a curve and a plan of speeds."""
