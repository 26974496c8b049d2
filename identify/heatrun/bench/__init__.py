"""From bench files to records: readers, channel map, checks, alignment, reduction to blocks."""
