"""What is off costs nothing: instruction counts of a step, as benchmarks/effect_costs.py takes them."""

import importlib.util
from pathlib import Path

import pytest

SCRIPT = Path(__file__).resolve().parents[2] / "benchmarks" / "effect_costs.py"
spec = importlib.util.spec_from_file_location("effect_costs", SCRIPT)
costs = importlib.util.module_from_spec(spec)
spec.loader.exec_module(costs)

lack = costs.missing_tools()
pytestmark = [pytest.mark.slow, pytest.mark.skipif(bool(lack), reason=f"instructions cannot be counted: no {lack}")]


@pytest.fixture(scope="module")
def engines(tmp_path_factory):
    return costs.Engines(tmp_path_factory.mktemp("engines"))


@pytest.mark.parametrize("effect", ["corona_charging", "pair_coulomb", "drag", "wind", "dielectrophoresis", "adhesion"])
def test_a_step_with_an_effect_off_runs_the_instructions_of_an_engine_that_lacks_its_row(engines, effect):
    """Within 0.5 %, to the same bits; and the effect is not idle: on, it costs at least that."""
    on, off, lacking, same = engines.compare(effect)
    assert off == pytest.approx(lacking, rel=costs.BOUND)
    assert same
    assert on > off * (1.0 + 0.5 * costs.BOUND)


def test_every_row_of_the_table_is_counted(engines):
    import cesim

    assert costs.table_rows() == [row["name"] for row in cesim.engine.effects()]
