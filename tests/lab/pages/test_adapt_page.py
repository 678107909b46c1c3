"""What the chapter on adaptation shows, by hand."""

from lab.studies.test_places import elsewhere, images

from lmmap_lab.pages import adapt_page


def test_the_table_has_a_row_for_each_light_and_camera():
    table = adapt_page.light_table(images())
    assert table.index.tolist() == [("low light", "events")]
    assert table["right (%)", "before"].iloc[0].startswith("75.0 (") and table["", "recordings"].tolist() == [
        2
    ]


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
