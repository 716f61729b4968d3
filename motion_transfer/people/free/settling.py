"""Skirts and long hair of photographed items, moved as today's are: they fall, and keep clear."""
