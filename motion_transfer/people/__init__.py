"""Synthetic people: photos with exact IUV, and drivers from motion."""
