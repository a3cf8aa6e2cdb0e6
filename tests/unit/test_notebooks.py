"""Every notebook is stored clean and runs from top to bottom."""

import json
from pathlib import Path

import pytest

FOLDER = Path(__file__).parents[2] / "notebooks"
NOTEBOOKS = sorted(FOLDER.glob("*.ipynb"))

pytestmark = [
    pytest.mark.skipif(not NOTEBOOKS, reason="an installed package has no notebooks/"),
    pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem),
]


def test_is_stored_without_outputs(path):
    cells = json.loads(path.read_text(encoding="utf-8"))["cells"]
    code = [cell for cell in cells if cell["cell_type"] == "code"]
    assert code
    assert all(cell["outputs"] == [] and cell["execution_count"] is None for cell in code)


@pytest.mark.filterwarnings("default")  # Jupyter's own
def test_runs_from_top_to_bottom_and_draws(path, tmp_path):
    for module in ("ipykernel", "ipywidgets"):
        pytest.importorskip(module, reason=f"{module} is missing: pip install 'cesim[notebook]'")
    nbclient = pytest.importorskip("nbclient", reason="nbclient is missing: pip install 'cesim[notebook]'")
    nbformat = pytest.importorskip("nbformat", reason="nbformat is missing: pip install 'cesim[notebook]'")

    notebook = nbformat.read(path, as_version=4)
    resources = {"metadata": {"path": str(tmp_path)}}
    nbclient.NotebookClient(notebook, timeout=60, kernel_name="python3", resources=resources).execute()

    outputs = [output for cell in notebook.cells for output in cell.get("outputs", [])]
    # What a slider's function prints and draws is in its widget, and so are its errors.
    widgets = notebook.metadata.get("widgets", {}).get("application/vnd.jupyter.widget-state+json", {"state": {}})
    of_widgets = [output for widget in widgets["state"].values() for output in widget["state"].get("outputs", ())]
    assert [output for output in outputs + of_widgets if output["output_type"] == "error"] == []
    for group in (outputs, of_widgets):
        assert any("image/png" in output.get("data", {}) for output in group)
