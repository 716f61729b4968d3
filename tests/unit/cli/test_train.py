"""How `mt train` is stopped."""

from __future__ import annotations

import os
import signal
import sys

import pytest

from motion_transfer.cli.train import stop_on_signals


def test_a_signal_in_the_midst_of_a_line_is_heard(monkeypatch, capfd) -> None:
    """Whoever writes to standard error then, as a handler would, is refused by Python."""

    class Busy:
        fileno = sys.stderr.fileno

        def write(self, _words: str) -> int:
            raise RuntimeError("reentrant call inside <_io.BufferedWriter name='<stderr>'>")

    with stop_on_signals() as stop:
        with monkeypatch.context() as patch:
            patch.setattr(sys, "stderr", Busy())
            os.kill(os.getpid(), signal.SIGTERM)
        assert stop.asked()
    assert stop.number == signal.SIGTERM
    assert capfd.readouterr().err == "mt: stopping after this step; once more to stop at once\n"


def test_the_second_signal_stops_at_once() -> None:
    # which a job in the background ignores
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        with pytest.raises(KeyboardInterrupt), stop_on_signals():
            os.kill(os.getpid(), signal.SIGINT)
            os.kill(os.getpid(), signal.SIGINT)
    finally:
        signal.signal(signal.SIGINT, before)
