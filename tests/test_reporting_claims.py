"""The evaluator of claims: one vocabulary, intervals against bounds, cases combined."""

from dataclasses import replace
from itertools import permutations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from jinja2 import UndefinedError
from scipy.stats import binomtest

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
    clustered_share,
    difference,
    exact,
    exact_count,
    geometric_mean,
    in_words,
    largest,
    mean,
    median,
    rate_difference,
    share,
    smallest,
    unknown,
)
from structlearn.reporting.findings import Findings
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
    one_person = replace(exact_count(3, 63), low=-np.inf, high=np.inf)
    assert claim("zero").verdict(one_person) == UNDECIDED


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


def test_yes_rests_on_each_cases_own_interval_and_no_on_the_widened_one():
    samples = np.array([0.5, 0.7, 0.9, 0.8])
    alone, of_many = mean(samples), mean(samples, comparisons=20)
    assert (alone.low, alone.high) == (of_many.low, of_many.high)
    assert of_many.refuting[0] < of_many.low < of_many.high < of_many.refuting[1]
    yes, no = ("at least", of_many.low), ("at most", of_many.low - 1e-9)
    assert [claim(*yes).verdict(one) for one in (alone, of_many)] == [YES, YES]
    assert [claim(*no).verdict(one) for one in (alone, of_many)] == [NO, UNDECIDED]
    near = claim(
        "above", samples.mean(), margin={"size": 1.01 * (of_many.high - of_many.value), "reason": "-"}
    )
    assert near.verdict(of_many) == NO_DIFFERENCE


def test_makers_widen_what_refutes_among_several_cases():
    samples = np.array([0.5, 0.7, 0.9, 0.8, 0.6, 0.4, 1.1, 1.4, 0.3])
    counts = (np.array([3, 4, 5]), np.array([40, 40, 40]))
    for make, arguments in (
        (mean, [samples]),
        (geometric_mean, [samples]),
        (median, [samples]),
        (difference, [samples, np.zeros(9)]),
        (share, [3, 40]),
        (clustered_share, counts),
        (rate_difference, [counts, (counts[0] - 2, counts[1])]),
    ):
        alone, among = make(*arguments), make(*arguments, comparisons=2)
        assert replace(among, widened=None) == alone
        assert among.refuting[0] < alone.low < alone.value < alone.high < among.refuting[1]


ENDS = st.tuples(st.floats(-1, 1), st.floats(0, 1), st.floats(0, 1), st.floats(0, 1), st.floats(0, 1))


@given(st.lists(ENDS, min_size=1, max_size=5), st.floats(-1, 1))
def test_the_smallest_and_the_largest_decide_like_all_cases(ends, bound):
    found = {
        str(place): Evidence(value, value - a, value + b, 9, widened=(value - a - c, value + b + d))
        for place, (value, a, b, c, d) in enumerate(ends)
    }
    for test, joined in (("above", smallest), ("below", largest)):
        (row,) = judged([claim(test, bound)], {"e": found})
        one = joined(found.values())
        assert claim(test, bound).verdict(one) == row.verdict
        assert one.low <= one.value <= one.high


def test_one_unknown_case_leaves_the_smallest_unknown():
    missing = unknown("nobody came")
    assert smallest([exact(1.0), missing]) is missing
    assert largest([exact(1.0), missing]).reason == "nobody came"
    assert claim().verdict(smallest([])) == NOT_TESTED


def test_where_nobody_hits_the_words_say_how_many_were_asked():
    found = clustered_share(np.zeros(40), np.full(40, 40))
    assert in_words(found, "share") == "0.0 % [0.0, 1.4] over 40 people"
    assert claim("at most", 0.05).verdict(found) == YES
    assert (found.n, found.people) == (1600, 40)
    hits = np.arange(8)
    assert in_words(clustered_share(hits, np.full(8, 20)), "share").endswith("over 8 people, ICC 0.06")
    assert clustered_share(np.zeros(0), np.zeros(0)) == UNKNOWN


def test_an_independent_share_has_clopper_and_pearsons_interval():
    expected = binomtest(3, 40).proportion_ci(0.95)
    assert (share(3, 40).low, share(3, 40).high) == pytest.approx(expected, abs=2e-4)
    assert in_words(share(3, 40), "share") == "7.5 % [1.6, 20.4]"


def test_a_difference_of_rates_has_an_interval_where_nobody_differs():
    none = (np.zeros(8), np.full(8, 63))
    nobody = rate_difference(none, none)
    assert nobody.low == -nobody.high
    assert 100 * clustered_share(*none).high <= nobody.high < 15.0
    assert claim("above").verdict(nobody) == UNDECIDED
    trials = np.full(12, 63)
    many, few = np.arange(24, 36), np.arange(12)
    apart, back = (rate_difference(*its) for its in permutations(((many, trials), (few, trials))))
    assert claim("above").verdict(apart) == YES
    assert (apart.value, apart.low, apart.high) == pytest.approx((-back.value, -back.high, -back.low))
    unpaired = rate_difference((many, trials), (few[::-1], trials))
    assert apart.high - apart.low < unpaired.high - unpaired.low
    assert rate_difference(([], []), ([], [])) == UNKNOWN


@given(
    st.lists(st.tuples(st.integers(0, 30), st.integers(0, 30), st.integers(1, 30)), min_size=1, max_size=9)
)
def test_every_rate_lies_inside_its_interval(people):
    first, second, trials = (np.array(column) for column in zip(*people, strict=True))
    found = clustered_share(np.minimum(first, trials), trials)
    assert 0.0 <= found.low <= found.value <= found.high <= 1.0
    apart = rate_difference(*((np.minimum(its, trials), trials) for its in (first, second)))
    assert apart.value - apart.low >= -1e-9
    assert apart.value <= apart.high + 1e-9


def test_a_skewed_quantity_has_an_interval_that_stays_positive():
    epochs = np.array([5.0, 5.1, 4.9, 5.2, 5.3, 4.8, 503.0])
    assert mean(epochs).low < 0.0
    for make in (median, geometric_mean):
        assert 0.0 < make(epochs).low < make(epochs).value < make(epochs).high
    assert (median(epochs).low, median(epochs).value, median(epochs).high) == (4.8, 5.1, 503.0)
    assert claim().verdict(median(epochs[:5])) == UNDECIDED  # too few for an interval


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


@pytest.mark.parametrize("cases", [1, 3])
def test_as_many_as_would_decide_do_so_in_four_of_five_draws(cases):
    """The spread and mean that were found are taken as true, so these are drawn from."""
    rng = np.random.default_rng(0)
    first = rng.standard_normal(9)
    first = 0.4 + (first - first.mean()) / first.std(ddof=1)
    count = int(claim().would_decide(mean(first), cases=cases).split()[1])
    draws = 0.4 + rng.standard_normal((1000, cases, count))
    verdicts = [combined([claim().verdict(mean(one)) for one in draw]) for draw in draws]
    assert verdicts.count(YES) / len(verdicts) == pytest.approx(0.8, abs=0.04)


def test_a_no_among_several_cases_takes_more():
    found = mean(np.array([-1.0, 2.0, 3.0, 1.0]), comparisons=9)
    alone = replace(found, widened=None)
    assert [claim("above").would_decide(one) for one in (found, alone)] == 2 * ["about 17 would decide"]
    assert [claim("below").would_decide(one) for one in (found, alone)] == [
        "about 28 would decide",
        "about 17 would decide",
    ]


def test_no_fewer_would_decide_than_did_not():
    three = mean(np.array([0.1, 1.0, 1.9]))  # with 3, the t quantile is 4.3
    assert claim().would_decide(three) == "about 9 would decide"
    barely = Evidence(1.0, -1e-9, 2.0, 3)
    assert claim().would_decide(barely) == "about 4 would decide"
    for found, words in (
        (Evidence(1.0, 0.5, 1.5, 8), ""),
        (Evidence(0.01, -1.0, 1.02, 8), "more than 500 would decide"),
        (mean(np.array([1.0])), ""),
        (UNKNOWN, ""),
    ):
        assert claim().would_decide(found) == words


def test_nobody_of_a_few_leaves_a_rate_open_until_enough_were_asked():
    rare = claim("at most", 0.05)
    found = {people: clustered_share(people * [0], people * [40]) for people in range(4, 20)}
    open_ones = [people for people, one in found.items() if rare.verdict(one) == UNDECIDED]
    assert open_ones == list(range(4, open_ones[-1] + 1))
    assert rare.would_decide(found[4]) == f"about {open_ones[-1] + 1} would decide"
    often = claim("at least", 0.95)
    assert often.would_decide(clustered_share(4 * [40], 4 * [40])) == rare.would_decide(found[4])


def test_a_claim_without_a_unit_has_that_of_its_finding():
    find = Findings()
    find.exact("e", 3.0, unit="mm")
    words = [judged([claim(unit=unit)], find)[0].cases[0][1] for unit in ("", "mm more")]
    assert words == ["3.00 mm", "3.00 mm more"]
