"""stridecast: on-line human locomotion from motion capture."""
