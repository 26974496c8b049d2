"""The version that results and files state."""

__version__ = "0.1.0"
