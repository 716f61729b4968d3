"""Repairs of IUV sequences: frames without people, speckles, trembling borders; all streaming."""
