"""From the columns of a file to canonical channels in canonical units."""
