"""One reader for each format of a bench file."""
