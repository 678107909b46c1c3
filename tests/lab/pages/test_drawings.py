"""Ink and colours of figures stand out on both pages as WCAG 2.1 asks at level AA: text 4.5:1, lines 3:1."""

import matplotlib.pyplot as plt
import numpy as np
import pytest
from matplotlib.colors import to_rgb

from lmmap_lab.pages import drawings
from lmmap_lab.pages.drawings import COLOUR

WHITE, DARK, SHEET = "#ffffff", "#14181e", "#f4f4f4"  # the two pages, and the sheet below pictures on one
HALF_TURN = np.array([[-0.574, 1.43, 0.144], [0.426, 0.43, 0.144], [0.426, 1.43, -0.856]])  # of CSS's hues


def on_dark_page(colour) -> np.ndarray:
    """A drawing's colour as the style sheet turns it: inverted, its hue turned back."""
    return np.clip(HALF_TURN @ (1 - np.array(to_rgb(colour))), 0, 1)


def contrast(ink, paper) -> float:
    light = []
    for colour in (ink, paper):
        c = np.array(to_rgb(colour))
        linear = np.where(c <= 0.04045, c / 12.92, ((c + 0.055) / 1.055) ** 2.4)
        light.append(linear @ [0.2126, 0.7152, 0.0722] + 0.05)
    return max(light) / min(light)


def test_contrast_by_hand():
    assert contrast("#000000", WHITE) == pytest.approx(21)
    assert contrast("#777777", WHITE) == pytest.approx(4.48, abs=0.01)


@pytest.mark.parametrize("name", COLOUR)
def test_a_colour_stands_out_on_either_page(name):
    least = 4.5 if name == "ink" else 3
    assert contrast(COLOUR[name], WHITE) >= least and contrast(COLOUR[name], SHEET) >= least
    assert contrast(on_dark_page(COLOUR[name]), DARK) >= least


def test_ticks_of_a_logarithmic_axis_are_plain_numbers():
    fig, ax = plt.subplots()
    ax.semilogy([0, 1], [0.3, 0.9])
    drawings.plain_log(ax.yaxis)
    fig.canvas.draw()
    shown = [text.get_text() for text in ax.get_yticklabels(which="both") if text.get_text()]
    assert "0.5" in shown and all(float(text) > 0 and "e" not in text for text in shown)
    plt.close(fig)
