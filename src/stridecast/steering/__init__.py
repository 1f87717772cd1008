"""From a wish to lawful movement of the vehicle."""
