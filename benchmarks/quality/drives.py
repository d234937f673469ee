"""Drive the planned tour on several worlds: the table and the picture of docs/results/tours.md.

    python benchmarks/quality/drives.py --out DIR [WORLD[:SEED] ...] [--noise medium] [--close 5] [--picture PNG]

Every run keeps its directory in DIR and is not repeated when that is there. One process, nothing recorded.
"""

import argparse
import json
from pathlib import Path
from typing import Any

from closedrooms.pipeline.options.run import RunConfig
from closedrooms.pipeline.run import run

RUNS = ("office-01", "office-02", "office-02:1", "office-07", "school-02", "school-03", "school-03:1", "school-05")
HEAD = (
    "world", "seed", "status", "planned [m]", "driven [m]", "full knowledge [m]", "driven / full", "area covered",
    "mean IoU before", "mean IoU after", "new tours", "given up", "simulated [s]",
)  # fmt: skip


def driven(name: str, out: Path, options: argparse.Namespace) -> dict[str, Any]:
    """Read the ``metrics`` of one run, made unless it is there."""
    world, _, seed = name.partition(":")
    folder = out / f"{Path(world).stem}-{seed or 0}"
    if not (folder / "run.json").exists():
        run(
            RunConfig(
                world=world, seed=int(seed or 0), noise=options.noise, close=options.close, drive=True,
                record=False, out=folder,
            )
        )  # fmt: skip
    metrics: dict[str, Any] = json.loads((folder / "run.json").read_text())["metrics"]
    return metrics


def row(name: str, metrics: dict[str, Any]) -> list[str]:
    drive = metrics["drive"]
    world, _, seed = name.partition(":")
    full = drive["full_knowledge_length_m"]
    return [
        Path(world).stem,
        seed or "0",
        drive["status"],
        f"{drive['planned_length_m']:.0f}",
        f"{drive['driven_length_m']:.0f}",
        f"{full:.0f}",
        f"{drive['driven_length_m'] / full:.2f}",
        f"{100 * drive['area_covered']:.1f} %",
        f"{metrics['room_iou_mean']:.2f}",
        f"{drive['room_iou_mean_end']:.2f}",
        str(drive["replans"]),
        str(drive["vertices_unreachable"]),
        f"{drive['simulated_s']:.0f}",
    ]


def doors_row(name: str, metrics: dict[str, Any]) -> list[str]:
    """Compare IoU behind each door as planned, and at the end, when it had been opened and driven into."""
    before, after = metrics["room_iou"], metrics["drive"]["room_iou_end"]
    pairs = [f"{door} {before[door]:.2f} to {after.get(door, 0.0):.2f}" for door in sorted(before)]
    return [name.replace(":", ", seed "), ", ".join(pairs)]


def montage(folders: list[Path], picture: Path, *, width: int = 760) -> None:
    """Join the pictures of the driven paths, two in a row."""
    from PIL import Image, ImageDraw

    from closedrooms.visualization.canvas import font

    tiles = []
    for folder in folders:
        with Image.open(folder / "drive.png") as image:
            tile = image.convert("RGB").resize((width, round(image.height * width / image.width)))
        tiles.append((folder.name, tile))
    rows = [tiles[i : i + 2] for i in range(0, len(tiles), 2)]
    heights = [max(tile.height for _, tile in row) + 34 for row in rows]
    sheet = Image.new("RGB", (2 * width + 12, sum(heights)), "white")
    draw = ImageDraw.Draw(sheet)
    y = 0
    for tiles_of_row, height in zip(rows, heights, strict=True):
        for column, (name, tile) in enumerate(tiles_of_row):
            draw.text((column * (width + 12) + 4, y + 16), name, fill="black", font=font(18), anchor="lm")
            sheet.paste(tile, (column * (width + 12), y + 32))
        y += height
    # Few colours are left of maps and paths: a palette keeps the file small.
    sheet.quantize(128).save(picture, optimize=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("runs", nargs="*", default=RUNS, metavar="WORLD[:SEED]")
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--noise", default="medium", choices=("none", "low", "medium", "high"))
    parser.add_argument("--close", type=int, default=5)
    parser.add_argument("--picture", type=Path)
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    print(f"| {' | '.join(HEAD)} |\n|{' --- |' * len(HEAD)}", flush=True)
    doors, folders = [], []
    for name in options.runs:
        metrics = driven(name, options.out, options)
        print(f"| {' | '.join(row(name, metrics))} |", flush=True)
        doors.append(doors_row(name, metrics))
        world, _, seed = name.partition(":")
        folders.append(options.out / f"{Path(world).stem}-{seed or 0}")
    print("\n| world | IoU behind each door, as planned and after it was opened |\n| --- | --- |")
    for line in doors:
        print(f"| {' | '.join(line)} |")
    if options.picture:
        montage(folders, options.picture)


if __name__ == "__main__":
    main()
