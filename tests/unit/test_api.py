"""The function and the command line take the same options."""

from __future__ import annotations

import inspect

from motion_transfer import render_video
from motion_transfer.option import list_options
from motion_transfer.render.options import RenderOptions


def test_the_function_takes_every_option_by_its_name() -> None:
    keywords = inspect.signature(render_video).parameters
    options = {entry.name: entry for entry in list_options(RenderOptions)}
    assert keywords.keys() == {*options, "listener"}
    for name, parameter in keywords.items():
        assert parameter.kind is not inspect.Parameter.VAR_KEYWORD
        same = name in options and not options[name].required and name != "frames"
        if same:
            assert parameter.default == options[name].default
