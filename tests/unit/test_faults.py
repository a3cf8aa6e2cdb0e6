"""The deliberate faults of tests/faults still apply; `python tests/faults/run.py` builds them and sees them noticed."""

import importlib.util
import sys
from pathlib import Path

import pytest

FOLDER = Path(__file__).resolve().parents[1] / "faults"


def load():
    spec = importlib.util.spec_from_file_location("faults_table", FOLDER / "table.py")
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module  # where its dataclass looks itself up
    spec.loader.exec_module(module)
    return module


TABLE = load()


@pytest.mark.parametrize("fault", TABLE.FAULTS, ids=lambda fault: fault.what)
def test_a_fault_still_changes_its_file_and_its_test_is_there(fault):
    text = (TABLE.ROOT / fault.file).read_text(encoding="utf-8")
    assert fault.applied(text) != text
    file, _, name = fault.test.partition("::")
    tests = (TABLE.ROOT / file).read_text(encoding="utf-8")
    assert not name or f"def {name.partition('[')[0]}(" in tests


def test_a_fault_whose_text_has_gone_is_an_error():
    with pytest.raises(ValueError, match="0 times"):
        TABLE.FAULTS[0].applied("nothing of the kind")


def test_no_fault_is_there_twice():
    assert len({(fault.file, fault.changes) for fault in TABLE.FAULTS}) == len(TABLE.FAULTS) >= 20
