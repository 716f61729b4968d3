"""Signals that are kept until they are asked for."""

from __future__ import annotations

import signal
import threading

import pytest

from motion_transfer.batch.signals import Signals

NUMBERS = (signal.SIGINT, signal.SIGTERM)


class Halting:
    """What a scheduler does about the first Ctrl-C."""

    halted = False

    def __call__(self) -> bool:
        before, self.halted = self.halted, True
        return not before


class Ended(BaseException): ...


@pytest.fixture(autouse=True)
def terminating(monkeypatch: pytest.MonkeyPatch):
    """SIGTERM raises, as the command line has it."""

    def end(_number: int, _frame: object) -> None:
        raise Ended

    before = signal.signal(signal.SIGTERM, end)
    yield
    signal.signal(signal.SIGTERM, before)


def test_the_first_ctrl_c_halts_and_the_second_stops() -> None:
    halt, signals = Halting(), Signals()
    before = [signal.getsignal(number) for number in NUMBERS]
    with signals.noted():
        signals.heed(halt)
        assert not halt.halted and not signals.interrupted
        signal.raise_signal(signal.SIGINT)
        assert not halt.halted and signals.interrupted
        signals.heed(halt)
        assert halt.halted
        signal.raise_signal(signal.SIGINT)
        with pytest.raises(KeyboardInterrupt):
            signals.heed(halt)
        signals.heed(halt)
    assert [signal.getsignal(number) for number in NUMBERS] == before


def test_two_at_once_stop() -> None:
    signals = Signals()
    with signals.noted():
        signal.raise_signal(signal.SIGINT)
        signal.raise_signal(signal.SIGINT)
        with pytest.raises(KeyboardInterrupt):
            signals.heed(Halting())


def test_a_ctrl_c_after_a_halt_stops() -> None:
    halt, signals = Halting(), Signals()
    halt()
    with signals.noted(), pytest.raises(KeyboardInterrupt):
        signal.raise_signal(signal.SIGINT)
        signals.heed(halt)


def test_sigterm_does_later_what_it_would_have_done() -> None:
    halt, signals = Halting(), Signals()
    with signals.noted():
        signal.raise_signal(signal.SIGTERM)
        with pytest.raises(Ended):
            signals.heed(halt)
    assert not halt.halted and not signals.interrupted


def test_what_nobody_asked_for_is_done_at_the_end() -> None:
    signals = Signals()
    with pytest.raises(Ended), signals.noted():
        signal.raise_signal(signal.SIGINT)
        signal.raise_signal(signal.SIGTERM)
    assert signals.interrupted


def test_a_sigterm_that_nobody_handles_stays_as_it_is() -> None:
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    with Signals().noted():
        assert signal.getsignal(signal.SIGTERM) is signal.SIG_DFL


def test_other_threads_leave_the_handlers_alone() -> None:
    before = [signal.getsignal(number) for number in NUMBERS]
    inside: list[object] = []

    def work() -> None:
        with Signals().noted():
            inside.extend(signal.getsignal(number) for number in NUMBERS)

    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
    assert inside == before
