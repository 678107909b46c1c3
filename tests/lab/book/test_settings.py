"""The list of settings on the package's page has every field, its default, and the comment beside it."""

import re

import pytest
from lmmap_settings import field_list

from lmmap import settings

ITEM = re.compile(r"\* ``(\w+)``: ``(.+?)``(?:, .+)?")
CLASSES = [settings.PaperSettings, settings.MotionSettings, settings.BetweenSettings, settings.Settings]


@pytest.mark.parametrize("cls", CLASSES)
def test_every_field_is_listed_with_its_default(cls):
    items = [line for line in field_list(cls) if line.startswith("* ")]
    assert [re.match(r"\* ``(\w+)``", item)[1] for item in items] == list(cls.__annotations__)
    whole = [match for item in items if (match := ITEM.fullmatch(item))]
    for name, default in (match.groups() for match in whole):
        assert eval(default, vars(settings)) == getattr(cls, name)
    assert len(items) - len(whole) == sum(bool(re.search(r": a `\w+Settings`", item)) for item in items)


def test_comments_stand_where_they_do_in_the_source():
    lines = field_list(settings.Settings)
    assert lines[lines.index("Ellipse:") + 2].startswith("* ``ransac_hypotheses``: ``500``, H of the paper")


def test_a_class_without_defaults_keeps_its_signature():
    assert field_list(settings.PerCamera) == []
