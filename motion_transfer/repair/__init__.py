"""Repairs of IUV sequences: blends, speckles, gaps, trembling borders; all streaming."""
