from __future__ import annotations

import signal
import sys
import time
import weakref

import pytest

from koopcli.interrupts import interruptible


class Thing:
    pass


@pytest.mark.parametrize(("sent", "raised"), [(signal.SIGINT, KeyboardInterrupt), (signal.SIGTERM, SystemExit)])
def test_an_interrupt_in_a_callback_of_the_interpreter_is_not_lost(sent, raised, capfd):
    """Where Python cannot raise, as in the clean-up of a weak reference, it is raised again a moment later."""

    def strike(_):
        signal.raise_signal(sent)

    went_on = []

    def struck():
        with interruptible():
            thing = Thing()
            reference = weakref.ref(thing, strike)
            del thing
            went_on.append(reference() is None)
            time.sleep(5)

    with pytest.raises(raised):
        struck()
    assert went_on == [True]
    assert capfd.readouterr().err == ""


def test_other_failures_of_callbacks_are_reported_as_ever(monkeypatch):
    seen = []
    monkeypatch.setattr(sys, "unraisablehook", lambda lost: seen.append(lost.exc_type))
    with interruptible():
        thing = Thing()
        reference = weakref.ref(thing, lambda _: 1 / 0)
        del thing
    assert reference() is None
    assert seen == [ZeroDivisionError]


def test_everything_is_as_before_afterwards():
    before = signal.getsignal(signal.SIGTERM), signal.getsignal(signal.SIGALRM), sys.unraisablehook
    with interruptible():
        assert signal.getsignal(signal.SIGTERM) != before[0]
    assert (signal.getsignal(signal.SIGTERM), signal.getsignal(signal.SIGALRM), sys.unraisablehook) == before


@pytest.mark.parametrize("sent", [signal.SIGINT, signal.SIGTERM])
def test_an_ignored_signal_stays_ignored(sent):
    """As Unix wants it of a command that `nohup` or a shell's `&` began."""
    before = signal.signal(sent, signal.SIG_IGN)
    try:
        with interruptible():
            signal.raise_signal(sent)
        assert signal.getsignal(sent) == signal.SIG_IGN
    finally:
        signal.signal(sent, before)
