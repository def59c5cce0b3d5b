"""Calls side by side in threads."""

import threading

import pytest

from distretarget.numerics import threads
from distretarget.numerics.threads import cores, in_threads


@pytest.fixture(params=[1, 4], autouse=True)
def _any_cores(request, monkeypatch):
    monkeypatch.setattr(threads, "cores", lambda: request.param)


def test_results_are_those_of_map_in_order():
    assert list(in_threads(pow, range(20), range(1, 21))) == list(map(pow, range(20), range(1, 21)))


def test_calls_run_side_by_side(monkeypatch):
    """Each waits for the other, so that neither could end alone."""
    monkeypatch.setattr(threads, "cores", lambda: 2)
    meeting = threading.Barrier(2, timeout=60)
    assert sorted(in_threads(lambda _: meeting.wait(), range(2))) == [0, 1]


def test_an_error_of_a_call_reaches_the_caller():
    with pytest.raises(ZeroDivisionError):
        list(in_threads(lambda x: 1 // x, [1, 0, 2]))


def test_without_calls_there_are_no_results():
    assert list(in_threads(pow, [], [])) == []


def test_there_is_a_core():
    assert cores() >= 1
