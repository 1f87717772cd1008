"""Many people at once: who sees whom, what they do about it, and that nobody runs into anybody."""
