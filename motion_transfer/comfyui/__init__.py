"""Nodes for ComfyUI. This folder, or a link to it, goes into ComfyUI's `custom_nodes`."""

from __future__ import annotations

# by its whole name: ComfyUI imports this folder by another one
from motion_transfer.comfyui.nodes import NODE_CLASS_MAPPINGS, NODE_DISPLAY_NAME_MAPPINGS

__all__ = ["NODE_CLASS_MAPPINGS", "NODE_DISPLAY_NAME_MAPPINGS"]
