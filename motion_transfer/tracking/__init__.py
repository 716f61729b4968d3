"""The body model fitted to people in clips: a clip becomes 3D motion."""
