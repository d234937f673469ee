"""The notebook of the tutorial: run it (``python docs/notebook_page.py``), and show it as a page of the site."""

import base64
import json
from pathlib import Path
from typing import Any

NOTEBOOK = Path(__file__).resolve().parent / "tutorial" / "your-map.ipynb"
# A cell takes a second or two; a busy machine ten times that [s].
PATIENCE = 300


def execute(path: Path) -> Any:
    """Run every cell in a fresh kernel and return the notebook with what came out.

    Args:
        path: The notebook; it runs in its folder.

    Raises:
        nbclient.exceptions.CellExecutionError: A cell failed.
    """
    import nbformat
    from nbclient import NotebookClient

    notebook = nbformat.read(path, as_version=4)
    NotebookClient(notebook, timeout=PATIENCE, resources={"metadata": {"path": str(path.parent)}}).execute()
    for cell in notebook.cells:
        cell.metadata.pop("execution", None)
    return notebook


def write_page(folder: Path) -> None:
    """Write ``notebook.md`` and its pictures from what the notebook holds; nothing is run.

    Args:
        folder: Of the notebook.
    """
    cells = json.loads((folder / NOTEBOOK.name).read_text())["cells"]
    lines = []
    for number, cell in enumerate(cells):
        text = "".join(cell["source"])
        if cell["cell_type"] == "markdown":
            lines += [text, ""]
            continue
        lines += ["```python", text, "```", ""]
        for output in cell["outputs"]:
            lines += _shown(output, folder, f"notebook-{number:02d}.png")
    (folder / "notebook.md").write_text("\n".join(lines))


def _shown(output: dict[str, Any], folder: Path, picture: str) -> list[str]:
    data = output.get("data", {})
    if "image/png" in data:
        (folder / picture).write_bytes(base64.b64decode(data["image/png"]))
        return [f"![what the cell draws]({picture})", ""]
    text = "".join(output.get("text") or data.get("text/plain") or "").rstrip()
    return ["```text", text, "```", ""] if text else []


def main() -> None:
    """Run the notebook and keep what came out."""
    import nbformat

    nbformat.write(execute(NOTEBOOK), NOTEBOOK)


if __name__ == "__main__":
    main()
