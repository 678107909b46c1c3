"""The examples in the docstrings of public names run, and give what they show."""

import doctest
import inspect

import numpy as np
import pytest

import lmmap
from lmmap.shipped import DATA
from lmmap.types import EVENT

PUBLIC = {name: value for name in lmmap.__all__ if inspect.isclass(value := getattr(lmmap, name))
          or inspect.isfunction(value)}  # fmt: skip


@pytest.mark.parametrize("name", sorted(PUBLIC))
def test_examples_give_what_they_show(name, tmp_path):
    known = {"lmmap": lmmap, "np": np, "EVENT": EVENT, "DATA": DATA, "folder": tmp_path}
    text = inspect.getdoc(PUBLIC[name])
    test = doctest.DocTestParser().get_doctest(text, known, name, None, None)
    assert "Examples\n--------" in text and test.examples
    shown = []
    doctest.DocTestRunner().run(test, out=shown.append)
    assert "".join(shown) == ""
