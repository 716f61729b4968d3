"""Skin, faces, and hair."""
