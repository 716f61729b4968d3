"""Repairs of IUV sequences: blends, speckles, frames without people, trembling borders; all streaming."""
