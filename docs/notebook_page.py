"""The notebook of the tutorial as a page of the site: run whenever the site is built, so that both say the same."""

import base64
from pathlib import Path
from typing import Any

NOTEBOOK = Path(__file__).resolve().parent / "tutorial" / "your-map.ipynb"
# A cell takes a second or two; a busy machine ten times that [s].
PATIENCE = 300


def execute(path: Path) -> Any:
    """Run every cell in a fresh kernel and return the notebook with what came out; the file stays as it is.

    Args:
        path: The notebook; it runs in its folder.

    Raises:
        nbclient.exceptions.CellExecutionError: A cell failed.
    """
    import nbformat
    from nbclient import NotebookClient

    notebook = nbformat.read(path, as_version=4)
    NotebookClient(
        notebook, timeout=PATIENCE, startup_timeout=PATIENCE, resources={"metadata": {"path": str(path.parent)}}
    ).execute()
    return notebook


def write_page(notebook: Any, folder: Path) -> None:
    """Write ``notebook.md`` and its pictures.

    Args:
        notebook: With what came out of its cells.
        folder: Where to write.
    """
    lines = []
    for number, cell in enumerate(notebook["cells"]):
        text = "".join(cell["source"])
        if cell["cell_type"] == "markdown":
            lines += [text, ""]
            continue
        lines += ["```python", text, "```", ""]
        for output in cell["outputs"]:
            lines += _shown(output, folder, f"notebook-{number:02d}.png")
    (folder / "notebook.md").write_text("\n".join(lines))


def _shown(output: Any, folder: Path, picture: str) -> list[str]:
    data = output.get("data", {})
    if "image/png" in data:
        (folder / picture).write_bytes(base64.b64decode(data["image/png"]))
        return [f"![what the cell draws]({picture})", ""]
    text = "".join(output.get("text") or data.get("text/plain") or "").rstrip()
    return ["```text", text, "```", ""] if text else []
