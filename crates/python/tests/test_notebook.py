"""The notebook runs from its first cell to its last."""

import pathlib

import pytest


def test_the_notebook_runs(tmp_path):
    nbformat, nbclient = pytest.importorskip("nbformat"), pytest.importorskip("nbclient")
    place = pathlib.Path(__file__).resolve().parents[3] / "examples" / "three_papers.ipynb"
    notebook = nbformat.read(place, as_version=4)
    nbformat.validate(notebook)
    assert all(not cell.get("outputs") for cell in notebook.cells), "results are not committed"
    nbclient.NotebookClient(notebook, timeout=600, resources={"metadata": {"path": str(tmp_path)}}).execute()
    pictures = [o for c in notebook.cells for o in c.get("outputs", []) if "image/png" in o.get("data", {})]
    assert len(pictures) == 3
    nbformat.write(notebook, tmp_path / "done.ipynb")
    wrong = nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell("1 / 0")])
    with pytest.raises(nbclient.exceptions.CellExecutionError):
        nbclient.NotebookClient(wrong).execute()
