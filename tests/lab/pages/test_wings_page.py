"""The figure of the wings: a box a module, a line an import, and no line that leads upward."""

from lmmap_lab.pages import wings_page


def test_higher_wings_are_above_and_each_import_is_a_line():
    low = [f"files{k}" for k in range(wings_page.MOST + 1)]
    wings = {"cli": ["cli.main"], "files": low}
    (ax,) = wings_page.draw_wings(wings, [("cli.main", name) for name in low]).axes
    heights = {text.get_text(): text.get_position()[1] for text in ax.texts}
    assert set(heights) == {"cli", "files", "main", *low}
    assert heights["main"] > max(heights[name] for name in low)
    assert len({heights[name] for name in low}) == 2  # more than fit side by side
    assert len(ax.lines) == len(low) and all(y[0] > y[1] for _, y in (line.get_data() for line in ax.lines))
