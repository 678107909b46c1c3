"""The reproduction check: silent on noise, loud on a change, and never about nothing."""

import base64
import functools
import io
import json
import shutil

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pytest

from lmmap.types import InputError
from lmmap_lab import provenance
from lmmap_lab.pages import reference
from lmmap_lab.pages.inventory import inventory, table_numbers
from lmmap_lab.pages.reference import compare, deviation


@pytest.fixture
def made(tmp_path, rng):
    """Folders of results and of executed chapters, as `make reproduce` leaves them."""
    folder, chapters = tmp_path / "derived", tmp_path / "_build" / "jupyter_execute" / "book"
    lights = {"light": ["low", "high"], "ours": [0.512, 1.7], "detected_percent": [95.0, np.nan]}
    provenance.save_table(folder / "summary.csv", pd.DataFrame(lights))
    series = {
        "t_us": np.arange(60),
        "status": ["ok"] * 57 + ["no ellipse"] * 3,
        "error_m": rng.gamma(2, size=60),
    }
    provenance.save_table(folder / "errors.csv", pd.DataFrame(series))
    provenance.save_json(folder / "counts.json", {"images": 60, "shares": {"low": 0.4}})
    chapters.mkdir(parents=True)
    write_chapter(chapters, {"radius_mm": "80.0", "residual": "8.75e-12", "profile": "'quick'"}, figure())
    return folder, chapters


def write_chapter(chapters, numbers, png):
    glued = {name: {"data": {"text/plain": text}} for name, text in numbers.items()}
    (chapters / "rings.glue.json").write_text(json.dumps(glued))
    shown = {"outputs": [{"data": {"image/png": base64.b64encode(png).decode()}}]}
    (chapters / "rings.ipynb").write_text(json.dumps({"cells": [{}, shown]}))


@functools.cache
@plt.style.context("default")  # whatever other tests have set
def figure(scale=1.0, label="error (mm)"):
    fig, ax = plt.subplots(figsize=(7.0, 3.2), dpi=110)
    x = np.linspace(0, 1, 200)
    ax.plot(x, scale * np.sin(7 * x))
    ax.set(ylim=(-1.2, 1.2), ylabel=label)
    file = io.BytesIO()
    fig.savefig(file, transparent=True)
    plt.close(fig)
    return file.getvalue()


def states(before, folders):
    return compare(before, inventory(*folders)).set_index("item").state.to_dict()


def test_the_same_again_is_unchanged_whatever_the_commit(made, monkeypatch):
    before = json.loads(json.dumps(inventory(*made)))
    monkeypatch.setattr(provenance, "commit", lambda: "another")
    provenance.save_json(made[0] / "counts.json", {"images": 60, "shares": {"low": 0.4}})
    assert set(states(before, made).values()) == {"unchanged"}
    assert set(before) == {"summary.csv", "errors.csv", "counts.json", "rings, numbers", "rings, figure 1"}


def test_a_chapter_that_glues_nothing_has_its_figures_alone(made):
    (made[1] / "rings.glue.json").unlink()  # myst-nb writes none
    assert [item for item in inventory(*made) if item.startswith("rings")] == ["rings, figure 1"]


def edit_cell(path, factor):
    path.write_text(path.read_text().replace("0.512", f"{0.512 * factor:.6g}"))


def edit_series(path, factor):
    table = provenance.load_table(path)
    provenance.save_table(path, table.assign(error_m=factor * table.error_m))


def edit_json(path, factor):
    provenance.save_json(path, {"images": 60, "shares": {"low": 0.4 * factor}})


@pytest.mark.parametrize(
    "factor, state", [(1 + 1e-4, "within tolerance"), (1.05, "changed"), (0.95, "changed")]
)
@pytest.mark.parametrize(
    "name, edit", [("summary.csv", edit_cell), ("errors.csv", edit_series), ("counts.json", edit_json)]
)
def test_a_result_may_round_otherwise_but_not_change_by_five_percent(made, name, edit, factor, state):
    before = inventory(*made)
    edit(made[0] / name, factor)
    assert states(before, made) == {other: "unchanged" for other in before} | {name: state}


def test_so_may_a_glued_number_and_zero_is_zero(made):
    before = inventory(*made)
    for radius, residual, state in (("80.004", "3e-13", "within tolerance"), ("84.0", "8.75e-12", "changed")):
        write_chapter(made[1], {"radius_mm": radius, "residual": residual, "profile": "'quick'"}, figure())
        assert states(before, made)["rings, numbers"] == state
    write_chapter(made[1], {"radius_mm": "80.0", "residual": "8.75e-12", "profile": "'paper'"}, figure())
    assert states(before, made)["rings, numbers"] == "changed"


@pytest.mark.parametrize("picture, state", [
    (figure(1 + 1e-4), "within tolerance"), (figure(1.05), "changed"), (figure(label="error (m)"), "changed"),
    (figure(0), "changed"),
])  # fmt: skip
def test_a_figure_may_round_otherwise_but_not_show_another_line(made, picture, state):
    before = inventory(*made)
    (made[1] / "rings.ipynb").unlink()
    write_chapter(made[1], {"radius_mm": "80.0", "residual": "8.75e-12", "profile": "'quick'"}, picture)
    assert states(before, made)["rings, figure 1"] == state


def test_one_image_of_sixty_may_fall_on_the_other_side_of_a_gate_but_not_four(made):
    before, path = inventory(*made), made[0] / "errors.csv"
    table = provenance.load_table(path)
    for row, state in ((56, "within tolerance"), (53, "changed")):
        statuses = ["ok"] * row + ["no ellipse"] * (60 - row)
        provenance.save_table(path, table.assign(status=statuses, error_m=table.error_m))
        assert states(before, made)["errors.csv"] == state


def test_what_is_absent_or_new_has_changed(made):
    before = inventory(*made)
    (made[0] / "counts.json").rename(made[0] / "more.json")
    table = compare(before, inventory(*made)).set_index("item")
    assert table.why["counts.json"] == "is absent" and table.why["more.json"] == "is not in the reference"
    assert (table.state[["counts.json", "more.json"]] == "changed").all()


def test_numbers_within_words_are_numbers():
    table = pd.DataFrame(
        {"claim": ["a is better", "b is"], "ours": ["12.5 | 3.1 mm", "nan"], "holds": ["yes", "no"]}
    )
    numbers = table_numbers(table)
    assert numbers["a is better ours"] == "12.5 | 3.1 mm" and numbers["b is holds"] == "no"
    assert (
        deviation("x", "12.5 | 3.1 mm", "12.6 | 3.1 mm")
        < 1
        < deviation("x", "12.5 | 3.1 mm", "13.2 | 3.1 mm")
    )
    assert deviation("x", "12.5 | 3.1 mm", "12.5 mm") == np.inf


def test_words_and_unknown_numbers_have_no_tolerance():
    assert deviation("x", None, None) == 0 and deviation("x", "ok", "ok") == 0
    assert deviation("x", None, 1.0) == deviation("x", 1.0, None) == deviation("x", "ok", "no") == np.inf
    assert deviation("x quartiles", [1.0, 2.0, 3.0], [1.0, 2.0]) == np.inf


@pytest.fixture
def project(made, tmp_path):
    """Results, pages and place of the reference of a project, as `reference.check` takes them."""
    build = tmp_path / "_build"
    (build / "execution" / provenance.page_fingerprint()).mkdir(parents=True)
    return {"results": made[0], "build": build, "path": tmp_path / "reference.json"}


def test_check_says_what_has_changed_and_fails(project):
    lines = []

    def check(**options):
        lines.clear()
        reference.check(report=lines.append, **project, **options)
        return lines[-1]

    with pytest.raises(InputError, match="no reference"):
        check()
    check(update=True)
    assert "0 within tolerance, 0 changed" in check()
    edit_cell(project["results"] / "summary.csv", 1.05)
    with pytest.raises(InputError, match=r"1 of \d+ items have changed") as error:
        check()
    assert any("low ours: 0.512 -> 0.5376" in line for line in lines) and "\n" not in str(error.value)
    assert "another kind" in check(on="another")
    check(update=True)
    assert "0 changed" in check()


def test_pages_of_an_edited_module_are_not_checked(project):
    reference.check(update=True, **project)
    fresh = project["build"] / "execution" / provenance.page_fingerprint()
    fresh.rename(fresh.with_name("of another module"))
    with pytest.raises(InputError, match="make book"):
        reference.check(**project)


def test_nothing_to_check_is_no_success(project):
    reference.check(update=True, **project)
    shutil.rmtree(project["results"])
    shutil.rmtree(project["build"] / "jupyter_execute")
    for update in (False, True):  # an empty reference would agree with anything
        with pytest.raises(InputError, match="make book"):
            reference.check(update=update, **project)
