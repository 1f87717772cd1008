"""Many people at once: where they go, and what a human body can do of it."""
