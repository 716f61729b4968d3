"""A local page that shows a run frame by frame before it is rendered."""
