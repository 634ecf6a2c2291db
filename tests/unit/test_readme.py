"""Tables of README.md from a summary."""

import re
from pathlib import Path

import pytest

from addvc import readme
from addvc.errors import AddvcError

ROOT = Path(__file__).parents[2]
RESULT = {"converged": True, "error": {"rms": 0.0871, "p95": 0.1449}}
SUMMARY = {
    "meshes": {"meso12": {}, "micro": {}},
    "results": ["meso12", "meso12-network", "micro"],
    "states": [
        {"label": "3.4 %", "state": 1, "meso12": RESULT, "meso12-network": RESULT, "micro": RESULT},
        {
            "label": "9 %",
            "state": 2,
            "meso12": RESULT | {"converged": False},
            "meso12-network": RESULT,
            "micro": RESULT | {"error": None},
        },
    ],
    "cost": {
        "twin_foam": {"cpu_s": 4.4, "max_rss_mb": 300.0},
        "twin_scan": {"cpu_s": 5.0, "max_rss_mb": 310.0},
        "micro_dvc": {"cpu_s": 90.0, "max_rss_mb": 900.0},
        "struts": {"cpu_s": 3.0, "max_rss_mb": 200.0},
    },
}


def test_errors_say_what_did_not_converge_and_what_is_not_known():
    assert readme.accuracy(SUMMARY).splitlines()[2:] == [
        "| `meso12` | 0.087 / 0.145 | 0.087 / 0.145, not converged |",
        "| `meso12-network` | 0.087 / 0.145 | 0.087 / 0.145 |",
        "| `micro` | 0.087 / 0.145 | – |",
    ]


def test_other_tools_have_rows_of_their_own():
    peers = [
        {"tool": "micro, Eq. 10", "state": "1", "rms": "0.106", "p95": "0.175"},
        {"tool": "elastix 8", "state": "2", "rms": "0.138", "p95": "0.246"},
    ]
    assert readme.accuracy(SUMMARY, peers).splitlines()[5:] == ["| elastix 8 | – | 0.138 / 0.246 |"]


def test_every_rule_of_a_stage_exists_and_is_in_no_other():
    text = "".join(path.read_text() for path in (ROOT / "workflow/rules").glob("*.smk"))
    known = re.findall(r"^ *(?:use rule \w+ as|rule) (\w+)", text, re.M)
    listed = [rule for rules in readme.STAGES.values() for rule in rules]
    assert len(set(listed)) == len(listed) and set(listed) <= set(known)


def test_cost_is_summed_by_stage():
    lines = readme.cost(SUMMARY).splitlines()[2:]
    seconds = [float(line.split("|")[2]) for line in lines]
    assert [line.split("|")[1].strip() for line in lines] == [
        "twin and its scans", "micro DVC, both methods", readme.REST]  # fmt: skip
    assert sum(seconds) == pytest.approx(102.4, abs=1)


def test_a_table_replaces_what_is_between_its_marks():
    text = "a\n<!-- table cost -->\nold\n<!-- end -->\nb\n"
    once = readme.filled(text, {"cost": "new"})
    assert once == "a\n<!-- table cost -->\n\nnew\n\n<!-- end -->\nb\n"
    assert readme.filled(once, {"cost": "new"}) == once


def test_missing_marks_are_named():
    with pytest.raises(AddvcError, match="no mark `<!-- table cost -->`"):
        readme.filled("nothing", {"cost": "new"})


def test_readme_has_the_marks():
    text = (ROOT / "README.md").read_text()
    filled = readme.filled(text, {"accuracy": "of accuracy", "cost": "of cost"})
    assert filled.index("\nof accuracy\n") < filled.index("\nof cost\n")
