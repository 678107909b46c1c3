"""The dimensioned drawing shows the port that it is given."""

from dataclasses import replace

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.patches import Circle

from lmmap_lab.pages import port_page


def test_the_drawing_has_the_ports_own_dimensions(port):
    wide = replace(port, ring_outer_radius_m=0.09, plate_height_m=0.031)
    fig, (front, side) = plt.subplots(1, 2)
    port_page.draw_front(front, wide)
    port_page.draw_side(side, wide)
    radii = sorted(patch.radius for patch in front.patches if isinstance(patch, Circle))
    np.testing.assert_allclose(radii, [1e3 * wide.ring_inner_radius_m, 90])
    assert "31 mm" in {text.get_text() for text in side.texts}
    plt.close(fig)
