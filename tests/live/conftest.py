"""Programs that the tests of the live view start, and end in any case."""

import pytest
from browser import Browser
from processes import Programs


@pytest.fixture(scope="session")
def browser():
    with Browser() as started:
        yield started


@pytest.fixture
def programs():
    with Programs() as started:
        yield started
