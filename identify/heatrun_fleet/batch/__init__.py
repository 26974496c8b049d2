"""The fit of many machines at once, in compiled programs of a fixed size."""
