"""Page one types no number: what it shows are the committed tables' numbers."""

import re

import numpy as np
import pytest

from lmmap_lab.pages import intro_page
from lmmap_lab.provenance import DATA, ROOT, load_json, load_table
from lmmap_lab.studies import five_degrees_study
from lmmap_lab.studies.accuracy_run import COMMITTED
from lmmap_lab.studies.five_degrees_fit import ASKEW, LITERAL, NOISE
from lmmap_lab.studies.verdicts import ESTIMATORS, FAILS, HOLDS, NO_CLAIM, PARTLY, UNTESTED, other_results

PAGE = (ROOT / "book" / "intro.md").read_text()
CLAIMS = load_table(COMMITTED / "claims.csv").set_index("key")


def of_tables() -> dict:
    """Page one's numbers by the names under which they are glued, from the tables alone."""
    ladder = load_table(COMMITTED / "ladder.csv").query(
        "training == 'low-domain-gap' and outlier_filter == 'without' and statistic == 'median'"
    )
    by_rung = ladder.groupby(["metric", "rung"]).value.mean()
    paper = load_table(DATA / "paper" / "table1.csv").query(
        "training == 'low-domain-gap' and outlier_filter == 'without' and statistic == 'median'"
    )
    rates = load_table(COMMITTED / "default.csv").query("light != 'no port' and modality != 'fused'")
    pictures = (load_table(DATA / folder / "pictures.csv") for folder in ("results", "paper"))
    clean = intro_page.clean_pictures(*pictures)
    misfit = load_table(five_degrees_study.COMMITTED).query("variation == 'as it is'")
    misfit = misfit.set_index("hypothesis").misfit
    count = CLAIMS.verdict.value_counts()
    return {
        "accuracy_claims": count.drop(list(NO_CLAIM)).sum(),
        "accuracy_claims_hold": count[HOLDS],
        "accuracy_claims_partly": count[PARTLY],
        "accuracy_claims_fail": count[FAILS],
        "accuracy_claims_untested": count[UNTESTED],
        "accuracy_paper_deg": paper.value[paper.metric == "normal_error_deg"].mean(),
        "accuracy_as_printed_deg": by_rung["normal_error_deg", "as printed"],
        "accuracy_exact_deg": by_rung["normal_error_deg", "exact circle"],
        "accuracy_ours_deg": by_rung["normal_error_deg", "confident"],
        "degrees_noise": misfit[NOISE],
        "degrees_literal": misfit[LITERAL],
        "degrees_askew": misfit[ASKEW],
        "intro_default_right": np.floor(rates.right_percent.min()),  # at least, and at most
        "intro_default_wrong": np.ceil(10 * rates.wrong_percent.max()) / 10,
        "intro_position_fused": 1e3 * by_rung["position_error_m", "fused"],
        "intro_clean": len(clean),
        "intro_clean_right": clean.ring_right.sum(),
        "intro_clean_poses": (clean.status == "ok").sum(),
        "intro_minutes": intro_page.REPRODUCE_MINUTES,
    }


def test_its_numbers_are_those_of_the_tables():
    """The built page's numbers are the reference's, or ``lmmap check`` fails."""
    reference = load_json(DATA / "reference" / "quick.json")["items"]
    built = {
        k: v for page in ("intro", "accuracy") for k, v in reference[f"{page}, numbers"]["numbers"].items()
    }
    roles = re.findall(r"\{glue:text\}`(?:accuracy\.md::)?(\w+):[^`]*`", PAGE)
    tables = of_tables()
    assert set(roles) == set(tables) and len(roles) == PAGE.count("{glue:")
    for name, number in tables.items():
        text = isinstance(built[name], str)  # rounded where it is glued
        shown = float(built[name].strip("'")) if text else built[name]
        assert shown == pytest.approx(number, abs=5e-4 if text else 0, rel=1e-5), name


def test_no_number_is_typed():
    text = re.sub(r"\A---.*?\n---\n", "", PAGE, flags=re.S)
    captions = re.findall(r"caption: >-\n((?: {6}.*\n)+)", text)
    assert len(captions) == text.count("caption:") > 2
    prose = "\n".join([re.sub(r"^(`{3,}).*?^\1$", "", text, flags=re.S | re.M), *captions])
    for markup in (r"\{[\w:]+\}`[^`]*`", r"`[^`]*`", r"\]\([^)]*\)", r"^\d\. "):
        prose = re.sub(markup, "", prose, flags=re.M)
    assert "## The result" in prose
    assert not re.findall(r"\S*\d\S*", prose.replace("Table I", ""))
    typed = {
        name: found for name, title in intro_page.HEADLINES.items() if (found := re.findall(r"[\d.]+", title))
    }
    stated = other_results().set_index("quantity").value
    one_pixel = stated.filter(like="explained by one pixel").iloc[0]
    assert typed == {
        "sensitivity_explains": [one_pixel],
        "ten_hz": [stated.filter(like="pipeline rate").iloc[0]],
    }


def test_its_scorecard_has_the_numbers_and_verdicts_of_the_claims():
    shown = intro_page.scorecard(CLAIMS.reset_index()).data
    column = {name: estimator for estimator, name in ESTIMATORS.items()}
    for key, row in zip(intro_page.HEADLINES, shown.to_dict("records"), strict=True):
        claim = CLAIMS.loc[key]
        ours = claim[column[claim.decides]]
        assert row["claim"].startswith(intro_page.HEADLINES[key])
        here = f"{ours}<br><small>{claim.decides}</small>"
        assert (row["paper"], row["here"]) == tuple(t.replace(" | ", " and ") for t in (claim.paper, here))
        assert (
            row["verdict"]
            == f"<b>{claim.verdict}</b>"
            == f"<b>{claim[f'{column[claim.decides]}_verdict']}</b>"
        )
    assert (shown.verdict == f"<b>{FAILS}</b>").sum() >= 3, "failures stand among the headlines"
