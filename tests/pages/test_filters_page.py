"""The filters chapter's table: each number where it belongs."""

from itertools import product

import pandas as pd

from lmmap.pages import filters_page


def test_filters_stand_by_light_each_with_its_own_numbers():
    of = product(("low", "high"), ("ring", "reflector"), ("rgb", "event"))
    rows = [(light, f, m, "low", 0.1 * k, 1.0 * k) for k, (light, f, m) in enumerate(of)]
    table = pd.DataFrame(rows, columns=["light", "filter", "modality", "domain_gap", "iou", "skeleton_px"])
    wide = filters_page.filter_table(table).data
    assert wide.shape == (4, 4)
    for light, f, m, gap, iou, skeleton_px in rows:
        assert wide.loc[(gap, f, m), ("IoU", light)] == iou
        assert wide.loc[(gap, f, m), ("skeleton (px)", light)] == skeleton_px
