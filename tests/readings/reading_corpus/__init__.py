"""Bench files with their truth, made by code that shares nothing with the readers."""
