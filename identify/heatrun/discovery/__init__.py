"""Where simulation and measurement disagree, what is missing, and how far the gap shrinks."""
