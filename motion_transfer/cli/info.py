"""`mt info`."""

from __future__ import annotations

import json

import click


@click.command()
@click.argument("topic", type=click.Choice(["all", "parts"]), default="all")
@click.option("--json", "as_json", is_flag=True, help="Print JSON.")
def info(topic: str, as_json: bool) -> None:
    """Versions, device, renderers, sizes of a run; `mt info parts` lists part names."""
    from motion_transfer.render.about import describe_parts, describe_setup

    facts = describe_parts() if topic == "parts" else describe_setup()
    click.echo(json.dumps(facts, indent=2) if as_json else layout(facts))


def layout(facts: dict, indent: str = "") -> str:
    """Nested facts as aligned lines."""
    width = max((len(str(key)) for key in facts), default=0)
    lines = []
    for key, value in facts.items():
        if isinstance(value, dict):
            lines += [f"{indent}{key}", layout(value, indent + "  ")]
        else:
            listed = ", ".join(map(str, value)) if isinstance(value, list) else value
            lines.append(f"{indent}{key!s:<{width}}  {listed}")
    return "\n".join(lines)
