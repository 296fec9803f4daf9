import pytest
from committed import committed

from dissertation.scraping.protocol.cut_sweep import SweepParameters, downsampling_sweep, noise_sweep
from dissertation.scraping.world.demonstrator import DemonstratorParameters
from structlearn.core.errors import InputError
from structlearn.segmentation.cut_errors import mean_cut_errors_ms
from structlearn.segmentation.parameters import SegmentParameters

PRIMITIVES = [
    {"name": "down", "axis": "z", "threshold_m_s": 0.02},
    {"name": "turn", "axis": "between", "threshold_m_s": None},
    {"name": "scrape", "axis": "y", "threshold_m_s": 0.01},
]
FILTERS = {"guess_cutoff_hz": 2.0, "cut_cutoff_hz": 3.0, "align_cutoff_hz": 4.0}
REST = {"primitives": PRIMITIVES, "extension_s": 0.5, "downsampling": 4}
SEGMENT = committed(SegmentParameters, "segment", **FILTERS, **REST)
SIMULATION = committed(DemonstratorParameters, "simulate", count=4)


@pytest.fixture(scope="module")
def errors():
    levels = committed(SweepParameters, "segment_sweep", noise_mm=(0.0, 1.0), seeds=3, first_seed=0)
    return noise_sweep(levels, SIMULATION, SEGMENT)


def test_errors_grow_with_the_noise(errors):
    quiet, noisy = (
        mean_cut_errors_ms(errors[errors["noise_mm"] == noise])["mean_ms"] for noise in (0.0, 1.0)
    )
    assert quiet["wls"] < noisy["wls"]
    assert quiet["wls"] < 80.0


ONE_SET = committed(SweepParameters, "segment_sweep", noise_mm=(0.1,), seeds=1, downsampling=(1,))
FIRST, *OTHERS = SEGMENT.primitives
DEAF = SEGMENT.model_copy(update={"primitives": (FIRST.model_copy(update={"threshold_m_s": 5.0}), *OTHERS)})


def test_a_lost_reference_loses_the_set_and_is_counted():
    lost = noise_sweep(ONE_SET, SIMULATION, DEAF)
    assert lost["method"].tolist() == ["left_out"] * 4
    assert lost["start_error_s"].isna().all()


def test_every_person_is_cut_at_every_factor():
    factors = committed(SweepParameters, "segment_sweep", seeds=2, first_seed=0, downsampling=(1, 4))
    found = downsampling_sweep(factors, SIMULATION, SEGMENT)
    assert found[["seed", "factor"]].to_numpy().tolist() == [[0, 1], [0, 4], [1, 1], [1, 4]]
    work = found.pivot_table("work", "seed", "factor")
    assert (work[1] == 1.0).all()
    assert work[4].between(1 / 16, 1.1 / 16).all()
    lost = downsampling_sweep(factors, SIMULATION, DEAF)
    assert lost.empty
    assert "factor" in lost


def test_people_of_the_sweep_differ_but_share_the_noise_of_a_level():
    def swept(*between):
        chosen = {name: SIMULATION.between[name] for name in between}
        return noise_sweep(ONE_SET, SIMULATION.model_copy(update={"between": chosen}), SEGMENT)

    alike = swept()
    assert swept("noise_mm").equals(alike)
    assert not swept("durations_s").equals(alike)


def test_another_task_is_refused():
    other = SEGMENT.model_copy(update={"primitives": SEGMENT.primitives[:1]})
    with pytest.raises(InputError, match=r"segment\.primitives: names 1, the simulated task has 3"):
        noise_sweep(ONE_SET, SIMULATION, other)
