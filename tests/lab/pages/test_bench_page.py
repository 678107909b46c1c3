"""The plan of the laboratory has the lamps where the bench has them."""

import matplotlib.pyplot as plt

from lmmap_lab.bench.laboratory import EARTHSHINE_M, SUN_M
from lmmap_lab.pages import bench_page


def test_each_lamp_stands_where_the_bench_has_it(port, camera):
    fig, ax = plt.subplots()
    bench_page.draw_plan(ax, port, camera)
    places = {tuple(line.get_xydata()[0]) for line in ax.lines if len(line.get_xydata()) == 1}
    assert {(SUN_M[0], SUN_M[2]), (EARTHSHINE_M[0], EARTHSHINE_M[2]), (0, 0)} <= places
    plt.close(fig)
