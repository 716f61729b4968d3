"""Fabrics, outfits, and garments with geometry of their own."""
