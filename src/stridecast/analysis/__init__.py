"""From a motion to what the walker was doing."""
