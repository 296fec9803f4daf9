"""Run the notebook of the documentation: `examples/pick.py` gives `examples/pick.ipynb` with its outputs.

python docs/notebook.py              # `make docs` does

Same code, same bytes: cells are numbered, and nothing is kept of the machine or the time.
"""

import os
import re
import sys
import tempfile
from pathlib import Path

import jupytext
import nbformat
from nbclient import NotebookClient

from structlearn.core.artefacts import publish

SCRIPT = Path(__file__).parents[1] / "examples/pick.py"
TERMINAL = re.compile(r"\x1b\[[0-9;]*m|\r(?=\n)")  # colours and line ends


def main() -> None:
    """Run all cells in a folder of their own. Raises nbclient's CellExecutionError: a cell fails."""
    os.environ["TQDM_DISABLE"] = "1"  # no progress bars in what is kept
    os.environ["PATH"] = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])
    notebook = jupytext.read(SCRIPT)
    for number, cell in enumerate(notebook.cells):
        cell["id"] = f"cell-{number}"
    with tempfile.TemporaryDirectory() as folder:
        kept = {"record_timing": False, "coalesce_streams": True}
        where = {"metadata": {"path": folder}}
        NotebookClient(notebook, resources=where, startup_timeout=300, timeout=600, **kept).execute()
    for output in [output for cell in notebook.cells for output in cell.get("outputs", [])]:
        if output.output_type == "stream":
            output.text = TERMINAL.sub("", output.text).strip("\n")
    notebook.metadata = {"kernelspec": notebook.metadata["kernelspec"], "language_info": {"name": "python"}}
    with publish(SCRIPT.with_suffix(".ipynb")) as path:
        nbformat.write(notebook, path)


if __name__ == "__main__":
    main()
