"""Wrong usage: one line, exit status 2, and what was meant."""

import pytest

USAGE = {
    ("rum",): "unknown command 'rum'; did you mean run?",
    (
        "teleport",
    ): "unknown command 'teleport'; expected one of run, predict, cover, map, doors, edit, view, worlds, dataset,",
    ("--seed", "3"): "--seed before a command",
    ("worlds",): "no command after closedrooms worlds; expected one of list, show, generate, convert",
    ("worlds", "shw", "office-01"): "unknown command 'shw'; did you mean show?",
    ("run", "--nois", "high"): "unknown option --nois; did you mean --noise?",
    ("run", "--radius", "0.3"): "unknown option --radius; did you mean --sim.robot.radius?",
    ("run", "--no-recrod"): "unknown option --no-recrod; did you mean --record?",
    ("run", "--sim.nois.turn", "1"): "unknown option --sim.nois.turn; did you mean --sim.noise.turn?",
    ("predict", "--predictor.phi", "x"): "does not read --predictor.phi; closedrooms predict --help-all lists",
    ("predict", "--predictor.shortlst", "9"): "does not read --predictor.shortlst; did you mean --predictor.shortlist?",
    ("run", "--xyzzy"): "unknown option --xyzzy; closedrooms run --help-all lists what there is",
    ("worlds", "show", "a", "b", "--out", "x.png"): "unexpected argument 'b'",
    ("run", "--noise", "hihg"): "--noise: unknown value 'hihg'; did you mean high?",
    ("run", "--noise", "deafening"): "--noise: unknown value 'deafening'; expected one of none, low, medium, high",
    ("run", "--seed", "x"): "--seed: invalid literal",
    ("run", "--seed"): "--seed lacks a value",
    ("predict",): "missing MAP, --doors, --out; see closedrooms predict --help",
    ("predict", "--dors", "x"): "unknown option --dors; did you mean --doors?",
    ("run", "--method", "papre"): "unknown method 'papre'; did you mean paper?",
    ("robustness", "office-01", "--out", "x", "--method", "papre"): "unknown method 'papre'; did you mean paper?",
}


@pytest.mark.parametrize("words", USAGE, ids=" ".join)
def test_wrong_usage_is_one_line_that_says_what_was_meant(words, call, one_line):
    assert call(*words) == 2
    assert USAGE[words] in one_line()


@pytest.mark.parametrize("command", ["run", "predict"])
@pytest.mark.parametrize(
    "option", [("--preset", "best"), ("--structure=rose",), ("--phi", "as-printed")], ids=lambda words: words[0]
)
def test_options_of_old_name_the_method(command, option, call, one_line):
    assert call(command, *option) == 2
    line = one_line()
    assert "is gone; use --method" in line
    assert option[0].partition("=")[0] in line


@pytest.mark.parametrize(
    ("method", "option"),
    [
        ("best", "--predictor.phi"),
        ("rose", "--predictor.directions.min-length"),
        ("geometric", "--predictor.weights.area"),
        ("line-of-sight", "--predictor.keep-trace"),
    ],
)
def test_an_option_that_the_method_does_not_read_is_refused(method, option, call, one_line):
    assert call("run", "office-01", "--method", method, option, "1") == 2
    assert f"the method {method} does not read {option}" in one_line()


def test_the_method_decides_which_options_there_are(call, capsys):
    assert call("predict", "--method", "paper", "--help-all") == 0
    paper = capsys.readouterr().out
    assert call("predict", "--method=best", "--help-all") == 0
    best = capsys.readouterr().out
    assert "--predictor.weights.area" in paper
    assert "--predictor.weights.area" not in best
    assert "--predictor.door-width" in best


def test_a_missing_package_is_one_line_with_the_command_that_brings_it(call, one_line, monkeypatch):
    def missing(*_: object, **__: object) -> None:
        raise ModuleNotFoundError("No module named 'ortools'", name="ortools")

    monkeypatch.setattr("closedrooms.pipeline.cover.cover_map", missing)
    assert call("cover", "map.yaml", "--out", "o") == 1
    assert (
        one_line() == "closedrooms: closedrooms cover needs ortools, which is not installed here: pip install ortools"
    )
