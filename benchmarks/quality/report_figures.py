"""Add the figures of an evaluation of reported buildings to the ledger, a line a figure.

    python benchmarks/quality/report_figures.py EVALUATION --dataset "the authors' eight"

EVALUATION is a folder that ``closedrooms evaluate`` wrote. It is done once a version, after all decisions: the ledger
(``experiments/training/ledger.csv``) tells how often anybody looked.
"""

import argparse
import csv
import datetime
import subprocess
from pathlib import Path

from closedrooms.experiments.training.buildings import LEDGER, note_report

IOUS = {"matched_mean": "IoU a hidden room", "area_mean": "IoU of the whole area", "agreement_mean": "agreement"}
SURE = {
    "calibration_error": "calibration error",
    "auroc": "AUROC of confidence",
    "best_of_3": "IoU of the best of three",
    "brier": "Brier score a cell",
    "brier_guess": "Brier score a cell of the single guess",
}


def read_csv_rows(path: Path) -> list[dict[str, str]]:
    return list(csv.DictReader(path.read_text().splitlines())) if path.is_file() else []


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("evaluation", type=Path)
    parser.add_argument("--dataset", required=True)
    args = parser.parse_args()
    words = ("git", "rev-parse", "--short", "HEAD")
    commit = subprocess.run(words, cwd=LEDGER.parent, capture_output=True, text=True, check=True).stdout.strip()
    head = {"date": datetime.date.today().isoformat(), "commit": commit, "dataset": args.dataset}
    rows = []
    for table, names in (("summary", IOUS), ("sureness", SURE)):
        for row in read_csv_rows(args.evaluation / f"{table}.csv"):
            if row.get("closed_doors", "all") == "all" and row["method"] != "authors":
                rows += [
                    head | {"method": row["method"], "figure": figure, "value": f"{float(row[name]):.3f}"}
                    for name, figure in names.items()
                    if row.get(name)
                ]
    note_report(rows)
    print(f"{len(rows)} lines added to {LEDGER}")


if __name__ == "__main__":
    main()
