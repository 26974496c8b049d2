"""Files that appear whole or not at all, and what guards them."""
