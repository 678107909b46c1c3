"""The plan has the lamps where the bench has them; a watched pixel fires as in a recording."""

import matplotlib.pyplot as plt
import numpy as np

from lmmap_lab.bench import laboratory, sequences
from lmmap_lab.bench.event_sensor import SensorSettings
from lmmap_lab.bench.laboratory import EARTHSHINE_M, SUN_M
from lmmap_lab.pages import bench_page


def test_each_lamp_stands_where_the_bench_has_it(port, camera):
    fig, ax = plt.subplots()
    bench_page.draw_plan(ax, port, camera)
    places = {tuple(line.get_xydata()[0]) for line in ax.lines if len(line.get_xydata()) == 1}
    assert {(SUN_M[0], SUN_M[2]), (EARTHSHINE_M[0], EARTHSHINE_M[2]), (0, 0)} <= places
    plt.close(fig)


def test_the_events_of_a_pixel_add_up_to_the_change_of_its_log_light(port, camera):
    sequence = laboratory.sequence("test-medium")
    recording = sequences.simulate(sequence.name, 0.05)
    place = recording.events[len(recording.events) // 2]
    pixel = int(place["x"]), int(place["y"])
    t_us, light, own = bench_page.watch_pixel(sequence, camera, port, pixel, 0.05)
    same = recording.events[(recording.events["x"] == pixel[0]) & (recording.events["y"] == pixel[1])]
    np.testing.assert_array_equal(own, same)
    assert len(own) and np.all(np.diff(t_us) > 0) and t_us[-1] <= 50_000
    change = np.diff(np.log(light[[0, -1]] + SensorSettings().dark))[0]
    assert abs(np.where(own["p"], 1, -1).sum() * SensorSettings().threshold - change) < 1.2
