"""`mt completion`: what a shell needs to complete commands and options."""

from __future__ import annotations

import click
from click.shell_completion import get_completion_class

SHELLS = ("bash", "zsh", "fish")
VARIABLE = "_MT_COMPLETE"
"""By which click is asked for completions; made from the program's name."""


@click.command()
@click.argument("shell", type=click.Choice(SHELLS))
@click.pass_context
def completion(context: click.Context, shell: str) -> None:
    """Print what lets a shell complete commands and options.

    \b
    eval "$(mt completion bash)"                                  # in ~/.bashrc
    eval "$(mt completion zsh)"                                   # in ~/.zshrc
    mt completion fish > ~/.config/fish/completions/mt.fish       # once
    """
    script = get_completion_class(shell)
    assert script is not None  # click knows all three
    click.echo(script(context.find_root().command, {}, "mt", VARIABLE).source())
