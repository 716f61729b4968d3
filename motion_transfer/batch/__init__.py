"""Manifests of many runs: read, schedule over workers, resume, report."""
