"""The tabs of the live view."""
