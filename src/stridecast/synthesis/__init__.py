"""From movement to a body: blending, seams, feet."""
