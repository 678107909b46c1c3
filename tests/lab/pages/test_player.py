"""The player's plot: a column of it is a time, a row an error."""

import numpy as np

from lmmap_lab.pages import player


def dark_columns(picture):
    blue = (picture.astype(int) @ [-1, -1, 2]) > 60  # the colour of frames
    return np.flatnonzero(blue.any(0)), np.flatnonzero(blue.any(1))


def test_a_later_error_is_farther_right_and_a_larger_one_higher():
    places = []
    for t_s, error_mm in ((5.0, 2.0), (15.0, 2.0), (5.0, 50.0)):
        errors = {"rgb": np.array([[t_s], [error_mm]]), "event": np.empty((2, 0))}
        columns, rows = dark_columns(player.plot_errors(errors, [(0.0, "low light")], 20.0))
        places.append((columns.mean(), rows.mean()))
    width_px = 2 * player.WIDE_PX
    np.testing.assert_allclose([x for x, _ in places], width_px * np.array([0.25, 0.75, 0.25]), atol=2)
    assert places[2][1] < places[0][1] == places[1][1]
