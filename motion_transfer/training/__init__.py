"""Training: frozen networks that judge images, and what the trainer builds on."""
