"""What the commands' and studies' tests share."""

import pytest

from baryscope.study.campaign import flown


@pytest.fixture(scope="module", autouse=True)
def no_draw_is_flown_again():
    """For the report of each campaign, which there are many of: the tests of just that ask for it by --flights."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(flown, "SECONDS", 0.0)
        patch.setattr(flown, "FURTHER", 0.0)
        yield
