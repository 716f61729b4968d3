"""How one picture is drawn: its people, a window, a source, a renderer, a canvas."""
