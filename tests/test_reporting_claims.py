"""The evaluator of claims: one vocabulary, intervals against bounds, cases combined."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from jinja2 import UndefinedError

from dissertation.evidence.claims import (
    BY_CONSTRUCTION,
    NO,
    NO_DIFFERENCE,
    UNDECIDED,
    VERDICTS,
    YES,
    Claim,
    claim_metrics,
    claims_table,
    combined,
    judge,
    on_recordings,
    read_claims,
)
from structlearn.reporting.evidence import (
    NOT_TESTED,
    UNKNOWN,
    Evidence,
    by_case,
    clustered_share,
    difference,
    exact,
    exact_count,
    geometric_mean,
    in_words,
    mean,
    none_of,
    rate_difference,
    share,
    unknown,
)
from structlearn.reporting.prose import percent


def claim(test="above", bound=0.0, evidence="e", **entries):
    return Claim(statement="s", source="IV", evidence=evidence, test=test, bound=bound, **entries)


def judged(claims, found):
    return judge(claims, found, {})


def within(low, high):
    return Evidence(0.5 * (low + high), low, high, 9)


@pytest.mark.parametrize(
    ("test", "bound", "yes", "no", "undecided"),
    [
        ("above", 1.0, (1.1, 2.0), (0.2, 1.0), (0.9, 1.1)),
        ("below", 1.0, (0.2, 0.9), (1.0, 2.0), (0.9, 1.1)),
        ("at most", 1.0, (0.2, 1.0), (1.1, 2.0), (0.9, 1.1)),
        ("at least", 1.0, (1.0, 2.0), (0.2, 0.9), (0.9, 1.1)),
        ("between", [0.0, 1.0], (0.0, 1.0), (1.1, 2.0), (0.9, 1.1)),
    ],
)
def test_an_interval_decides_only_where_all_of_it_lies_on_one_side(test, bound, yes, no, undecided):
    one = claim(test, bound)
    assert [one.verdict(within(*ends)) for ends in (yes, no, undecided)] == [YES, NO, UNDECIDED]
    assert one.verdict(UNKNOWN) == NOT_TESTED
    assert one.verdict(mean(np.array([0.5]))) == UNDECIDED  # a single sample has no interval


def test_no_difference_needs_the_whole_interval_within_the_margin():
    near = claim("above", 1.0, margin={"size": {"": 0.2, "far": 0.05}, "reason": "smaller does not matter"})
    words = [
        near.verdict(within(*ends))
        for ends in ((0.85, 1.1), (0.75, 1.1), (0.9, 1.25), (1.01, 1.1), (0.9, 1.0))
    ]
    assert words == [NO_DIFFERENCE, UNDECIDED, UNDECIDED, YES, NO]
    assert near.verdict(within(0.9, 1.1), "far") == UNDECIDED
    assert near.would_decide(within(0.9, 1.1)) == ""
    assert combined([NO_DIFFERENCE, YES]) == NO_DIFFERENCE
    with pytest.raises(ValueError, match="one bound"):
        claim("between", [0.0, 1.0], margin={"size": 0.1, "reason": "-"})


def test_what_holds_by_construction_is_no_yes_and_says_why():
    marked = claim(by_construction="it is written so")
    words = judged([marked], {"e": {"a": exact(1.0, 3), "b": exact(2.0, 3)}})
    assert words[0].verdict == BY_CONSTRUCTION
    assert claim_metrics(words)["claims_yes"] == 0
    assert set(claims_table(words)["by_construction"]) == {"it is written so"}
    assert marked.verdict(exact(-1.0, 3)) == NO  # a fault shows all the same


def test_a_row_says_why_it_is_not_tested():
    (row,) = judged([claim()], {"e": unknown("nobody was there")})
    assert row.verdict == NOT_TESTED
    assert row.cases[0][1] == "not tested: nobody was there"


def test_zero_means_none_at_all():
    found = (exact_count(0, 63), exact_count(1, 63), UNKNOWN)
    assert [claim("zero").verdict(one) for one in found] == [YES, NO, NOT_TESTED]


@given(st.lists(st.sampled_from(VERDICTS), min_size=1, max_size=6))
def test_a_claim_is_yes_only_if_every_case_is(verdicts):
    assert (combined(verdicts) == YES) == (set(verdicts) == {YES})
    assert (combined(verdicts) == NO) == (NO in verdicts)


@given(st.integers(1, 10_000), st.data())
def test_a_rate_is_never_rounded_to_none_or_all(n, data):
    count = data.draw(st.integers(0, n))
    shown = float(percent(count, n).removesuffix(" %"))
    assert (shown == 0.0) == (count == 0)
    assert (shown == 100.0) == (count == n)
    found = share(count, n)
    assert 0.0 <= found.low <= found.value <= found.high <= 1.0


def test_numbers_in_words():
    assert in_words(within(0.1, 0.3), ".2f", "rad") == "0.20 [0.10, 0.30] rad"
    assert in_words(exact(-0.001, 4), ".2f") == "0.00"
    assert in_words(exact_count(3, 63), "count") == "3 of 63"
    assert in_words(share(503, 504), "share").startswith("99.8 %")
    assert in_words(UNKNOWN, ".2f") == NOT_TESTED


def test_each_case_has_its_bound_and_test():
    both = claim({"near": "at most", "far": "above"}, {"near": 1.0, "far": 2.0})
    (row,) = judged([both], {"e": {"near": exact(1.0, 2), "far": exact(2.0, 2)}})
    assert [case[-1] for case in row.cases] == [YES, NO]
    assert row.verdict == NO


def test_what_a_claim_names_must_have_been_found():
    with pytest.raises(ValueError, match="nothing was found for \\['e'\\]"):
        judged([claim()], {"other": exact(1.0, 1)})
    with pytest.raises(UndefinedError):
        judged([claim(note="{{ unknown }}")], {"e": exact(1.0, 1)})


@pytest.mark.parametrize(
    ("entry", "message"),
    [
        ("test: better", "unknown test"),
        ("test: at most", "needs a bound"),
        ("test: above\n  verdict: yes", "Extra inputs"),
    ],
)
def test_a_wrong_entry_is_refused(tmp_path, entry, message):
    path = tmp_path / "claims.yaml"
    path.write_text(f"- statement: s\n  source: IV\n  evidence: e\n  {entry}\n")
    with pytest.raises(ValueError, match=message):
        read_claims(path)


def test_metrics_count_what_the_dissertation_states():
    claims = [claim(), claim(by="ours"), claim("at most", 0.5)]
    rows = judged(claims, {"e": exact(1.0, 3)})
    counts = {word: count for word, count in claim_metrics(rows).items() if count}
    assert counts == {"claims_yes": 1, "claims_no": 1}
    assert list(claims_table(rows)["verdict"]) == [YES, YES, NO]


def covered(rate, correlation, people=8, trials=63, draws=400):
    """How often intervals hold the rate of a beta-binomial population: over people, and pooled."""
    rng = np.random.default_rng(0)
    strength = 1.0 / correlation - 1.0
    own = rng.beta(rate * strength, (1.0 - rate) * strength, size=(draws, people))
    found = [clustered_share(counts, np.full(people, trials)) for counts in rng.binomial(trials, own)]
    return (
        np.mean([one.low <= rate <= one.high for one in found]),
        np.mean([one.pooled_low <= rate <= one.pooled_high for one in found]),
    )


@pytest.mark.parametrize(
    ("rate", "correlation", "least", "pooled_most"),
    [
        (0.5, 0.1, 0.93, 0.65),
        (0.05, 0.1, 0.82, 0.60),  # rare: see `clustered_share`
        (0.01, 0.4, 0.99, 0.30),  # mostly nobody hits
        (0.05, 0.99, 0.95, 0.05),  # a person does it always or never
    ],
)
def test_the_interval_over_people_covers_where_the_pooled_one_does_not(rate, correlation, least, pooled_most):
    over_people, pooled = covered(rate, correlation)
    assert over_people >= least
    assert pooled <= pooled_most


def test_where_nobody_hits_people_count_and_not_their_trials():
    for trials in (1, 63, 10_000):
        none, every = (clustered_share(8 * [count], 8 * [trials]) for count in (0, trials))
        assert none.high == pytest.approx(max(1.0 - 0.05 ** (1 / 8), none.pooled_high))
        assert (every.low, every.high) == pytest.approx((1.0 - none.high, 1.0))
    found = clustered_share(8 * [0], 8 * [63])
    assert in_words(found, "share") == "0.0 % [0.0, 31.2] over 8 people, [0.0, 0.8] pooled"
    assert claim("at most", 0.05).verdict(found) == UNDECIDED
    of_two = by_case(clustered_share, {case: [[0] * 8, [63] * 8] for case in "ab"})["a"]
    assert of_two.high == none_of(8, comparisons=2) == pytest.approx(0.369, abs=5e-4)
    assert (found.n, found.people) == (504, 8)


def test_a_difference_of_rates_has_an_interval_where_nobody_differs():
    nobody = rate_difference(np.zeros(8), np.zeros(8))
    assert (nobody.low, nobody.value, nobody.high) == pytest.approx((-31.2, 0.0, 31.2), abs=0.05)
    assert claim("above").verdict(nobody) == UNDECIDED
    first = np.array([0.1, 0.2, 0.3])
    assert rate_difference(first, 0.5 * first) == difference(100 * first, 50 * first)
    pairs = difference(first, first - 0.05)
    assert (pairs.value, pairs.low, pairs.n) == pytest.approx((0.05, 0.05, 3))


def test_cases_of_every_maker_are_widened():
    samples = np.array([0.5, 0.7, 0.9, 0.8])
    for make, arguments in (
        (mean, [samples]),
        (geometric_mean, [samples]),
        (difference, [samples, np.zeros(4)]),
        (share, [3, 40]),
        (clustered_share, [[3, 4, 5], [40, 40, 40]]),
    ):
        alone, among = make(*arguments), by_case(make, {"a": arguments, "b": arguments})["a"]
        assert among.low < alone.low
        assert among.high > alone.high
        assert among.value == alone.value


def test_what_recordings_say_of_a_simulated_statement_stands_beside_it():
    own = judged([claim(), claim("below", by="ours", evidence="f")], {"e": exact(1.0, 3), "f": exact(1.0, 3)})
    like = {"testbed": "reaching", "evidence": "e"}
    told = [
        claim(simulated=like),
        claim(simulated=like | {"evidence": "f", "page": "feedback"}),
        claim(simulated=like | {"testbed": "another"}),
        claim(simulated=like | {"evidence": "never found"}),
        claim(),
    ]
    told = [one.model_copy(update={"statement": name}) for one, name in zip(told, "abcde", strict=True)]
    recorded = [replace(one, heading="People") for one in judged(told, {"e": exact(2.0, 5)})]
    both = on_recordings(claims_table(recorded), "reaching", claims_table(own))
    assert [(one.statement, one.there, one.simulated, one.recorded, one.found) for one in both] == [
        ("a", "s", YES, YES, ("2.00",)),
        ("b", "s", NO, YES, ("2.00",)),
    ]
    assert {one.heading for one in both} == {"People"}
    assert [one.counterpart.page for one in both] == ["index", "feedback"]
    assert on_recordings(claims_table([]).assign(set="", counterpart=""), "reaching", claims_table(own)) == []


def test_as_many_as_would_decide_do_so_in_four_of_five_draws():
    """The spread and mean that were found are taken as true, so these are drawn from."""
    rng = np.random.default_rng(0)
    first = rng.standard_normal(9)
    first = 0.4 + (first - first.mean()) / first.std(ddof=1)
    count = int(claim().would_decide(mean(first)).split()[1])
    verdicts = [claim().verdict(mean(draw)) for draw in 0.4 + rng.standard_normal((1000, count))]
    assert verdicts.count(YES) / len(verdicts) == pytest.approx(0.8, abs=0.06)
    for found, words in (
        (Evidence(1.0, 0.5, 1.5, 8), ""),
        (Evidence(0.01, -1.0, 1.02, 8), "more than 500 would decide"),
        (UNKNOWN, ""),
    ):
        assert claim().would_decide(found) == words


def test_nobody_of_a_few_leaves_a_rate_open_until_enough_were_asked():
    rare = claim("at most", 0.05)
    none_of_8, none_of_58, none_of_59 = (
        clustered_share(people * [0], people * [40]) for people in (8, 58, 59)
    )
    assert rare.would_decide(none_of_8) == "about 59 would decide"
    assert [rare.verdict(none_of_58), rare.verdict(none_of_59)] == [UNDECIDED, YES]
