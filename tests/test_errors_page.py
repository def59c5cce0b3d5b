"""The page of messages has every message of the source, and what helps."""

import make_errors
from make_errors import CURES, NOT_MESSAGES

from distretarget.io.files import REASONS


def test_the_page_is_up_to_date():
    assert make_errors.PAGE.read_text("utf-8") == make_errors.page(), "run tools/make_errors.py"


def test_nothing_is_told_of_messages_that_are_gone():
    texts = {message.text for message in make_errors.messages()} | set(REASONS.values())
    assert set(CURES) <= texts
    assert not NOT_MESSAGES & texts
