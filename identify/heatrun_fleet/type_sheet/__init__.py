"""The sheet of a type of machine: what its machines share, how they differ, which do not fit."""
