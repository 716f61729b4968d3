"""The function and the command line take the same options."""

from __future__ import annotations

import inspect
from pathlib import Path

import pytest

from motion_transfer import api, render_video
from motion_transfer.errors import InputError
from motion_transfer.option import list_options
from motion_transfer.render.options import RenderOptions


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch):
    """The options of the run that a call of the function asks for, instead of a run."""
    monkeypatch.setattr(api, "run", lambda options, _listener: options)
    return lambda *arguments, **keywords: render_video(*arguments, **keywords)


def test_the_function_takes_every_option_by_its_name() -> None:
    keywords = inspect.signature(render_video).parameters
    options = {entry.name: entry for entry in list_options(RenderOptions)}
    assert keywords.keys() == {*options, "listener"}
    for parameter in keywords.values():
        assert parameter.kind is not inspect.Parameter.VAR_KEYWORD


def test_what_is_not_given_is_as_on_the_command_line(asked) -> None:
    given = {"source": (Path("a.png"),), "driver": Path("d"), "output": Path("o.mp4")}
    assert asked("a.png", "d", "o.mp4") == RenderOptions(**given)


@pytest.mark.parametrize("given", [("", "d", "o.mp4"), ("a.png", "", "o.mp4"), ("a.png", "d", "")])
def test_an_empty_path_is_not_the_folder_where_we_are(asked, given: tuple[str, ...]) -> None:
    with pytest.raises(InputError, match="a path is empty; name a file or a folder"):
        asked(*given)
    with pytest.raises(InputError, match="a path is empty"):
        asked("a.png", "d", "o.mp4", weights="")


def test_one_source_or_several(asked) -> None:
    """Text or paths, alone or in a sequence; IUV likewise, one for each."""
    for one in ("a.png", Path("a.png"), ["a.png"], (Path("a.png"),)):
        assert asked(one, "d", "o.mp4").source == (Path("a.png"),)
    options = asked(["a.png", Path("b")], "d", "o.mp4", source_iuv=("a.npy", Path("b.mkv")))
    assert options.sources == [(Path("a.png"), Path("a.npy")), (Path("b"), Path("b.mkv"))]
    assert asked("a.png", "d", "o.mp4", source_iuv="a.npy").source_iuv == (Path("a.npy"),)
    assert asked(["a.png", "b"], "d", "o.mp4").source_iuv == ()


def test_no_source_is_said(asked) -> None:
    with pytest.raises(InputError, match="no source; give a photo"):
        asked([], "d", "o.mp4")
