"""The engine: plan a driver in chunks, prepare the source, render, lay out, encode, publish."""
