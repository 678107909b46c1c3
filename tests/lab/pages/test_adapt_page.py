"""What the chapter on adaptation shows, by hand."""

import pandas as pd
from lab.studies.test_places import elsewhere, images

from lmmap_lab.pages import adapt_page
from lmmap_lab.studies import places


def test_the_table_has_a_row_for_each_light_and_camera():
    table = adapt_page.light_table(images())
    assert table.index.tolist() == [("low light", "events")]
    assert table["right (%)", "before"].iloc[0].startswith("75.0 (") and table["", "recordings"].tolist() == [
        2
    ]


def test_what_the_whole_recording_teaches_stands_beside_what_its_half_does():
    half, whole = (pd.concat([seen, seen.assign(modality="rgb")]) for seen in (images(), images().assign(
        right=True, wrong=False)))  # fmt: skip
    table = adapt_page.whole_table(half, whole)
    assert table.index.get_level_values(0).tolist() == ["frames"] * 3 + ["events"] * 3
    right = table["right (%)"].loc["events"].str.split(" ").str[0]
    assert right.to_dict() == {"before": "75.0", "after the first half": "87.5", "after all of it": "100.0"}


def test_a_recording_is_a_line_from_before_to_after():
    (ax,) = adapt_page.draw_places(images()).axes
    joined = [line.get_xdata().tolist() for line in ax.lines if len(line.get_xdata()) == 2]
    assert joined == [[50, 75], [100, 100]]


def test_what_is_carried_over_has_a_row_for_each_pair_of_lights():
    table = adapt_page.carried_table(elsewhere())
    assert table.index.tolist() == [("low light", "medium light"), ("low light", "high light")]
    assert table["right", "after"].tolist() == [3, 3] and table["", "images"].tolist() == [4, 4]


def test_an_image_that_both_teach_counts_for_its_own_pose():
    kinds = adapt_page.label_kinds([True, True, False, False], [True, False, True, False])
    assert kinds.tolist() == [2, 1, 1]


def test_networks_that_had_labels_are_a_line_beside_those_that_learned():
    kinds = [("high", 0.0), ("high", 20.0), ("low", 0.0)]
    seen = pd.concat([images().assign(weights=w, seconds=s) for w, s in kinds])
    both = pd.concat([seen, seen.assign(modality="rgb")])
    (ax,) = adapt_page.draw_gap(places.by_seconds(both)).axes
    assert [line.get_linestyle() for line in ax.lines] == ["-", "--"] * 2
    assert ax.lines[0].get_xdata().tolist() == [0, 20]
