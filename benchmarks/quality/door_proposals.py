"""How well closed doors are found in maps alone: precision and recall against the doors that simulated runs closed.

    python benchmarks/quality/door_proposals.py RUN_FOLDER... [--tolerance 0.3] [--fit] [--quick]

A sample is any folder at any depth with ``map.yaml`` and ``doors.geojson`` (``closedrooms run`` leaves both). A
proposal is right when its middle lies within the tolerance of a closed door's, one proposal a door; the others are
wrong, also where the wall they lie in hides a room. Doors that the robot never saw are not asked for.

Samples are split by name: every other one of the sorted names, from the first, was used to choose the constants of
``predictor/structure/door_proposals.py`` (tuned), the rest was not (held out). ``--fit`` prints the logistic
regression on the former.
"""

import argparse
import math
import time
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from closedrooms.core.door import ClosedDoor
from closedrooms.core.files.geojson import read_doors
from closedrooms.core.files.rosmap import read_map
from closedrooms.predictor.structure.door_proposal_config import ProposalConfig
from closedrooms.predictor.structure.door_proposals import SMOOTH, DoorProposal, propose_doors

THRESHOLDS = (0.1, 0.3, 0.5, 0.7, 0.9)
QUICK = 8


@dataclass
class ProposedMap:
    """Proposals of one map, with the door that each hits (or ``None``)."""

    name: str
    doors: int
    seconds: float
    found: list[tuple[DoorProposal, ClosedDoor | None]] = field(default_factory=list)


def measure(folder: Path, tolerance: float) -> ProposedMap:
    grid, doors = read_map(folder / "map.yaml"), read_doors(folder / "doors.geojson")
    start = time.process_time()
    proposals = propose_doors(grid, ProposalConfig(min_score=0.0))
    sample = ProposedMap(folder.name, len(doors), time.process_time() - start)
    left = list(doors)
    for proposal in proposals:
        near = [door for door in left if math.dist(door.midpoint, proposal.midpoint) <= tolerance]
        hit = min(near, key=lambda door: math.dist(door.midpoint, proposal.midpoint), default=None)
        if hit is not None:
            left.remove(hit)
        sample.found.append((proposal, hit))
    return sample


def print_table(title: str, samples: list[ProposedMap]) -> None:
    if not samples:
        print(f"\n{title}: no maps")
        return
    doors = sum(sample.doors for sample in samples)
    found = [pair for sample in samples for pair in sample.found]
    print(f"\n{title}: {len(samples)} maps, {doors} closed doors, {len(found)} candidates")
    print(
        "| score at least | proposals | right | precision | recall | F1 |\n| ---: | ---: | ---: | ---: | ---: | ---: |"
    )
    for threshold in THRESHOLDS:
        chosen = [hit is not None for proposal, hit in found if proposal.score >= threshold]
        right = sum(chosen)
        precision, recall = right / max(len(chosen), 1), right / max(doors, 1)
        f1 = 2 * precision * recall / max(precision + recall, 1e-9)
        print(f"| {threshold} | {len(chosen)} | {right} | {precision:.3f} | {recall:.3f} | {f1:.3f} |")
    right_ones = [(proposal, hit) for proposal, hit in found if hit is not None and proposal.score >= 0.5]
    if right_ones:
        place = [math.dist(proposal.midpoint, hit.midpoint) for proposal, hit in right_ones]
        width = [abs(proposal.width - hit.width) for proposal, hit in right_ones if hit.width is not None]
        print(f"middle off by {np.mean(place):.3f} m, width by {np.mean(width):.3f} m (means of the right ones at 0.5)")
    print(f"CPU {np.mean([s.seconds for s in samples]):.2f} s a map, at most {max(s.seconds for s in samples):.2f} s")


def fit(samples: list[ProposedMap]) -> None:
    """Fit the regression whose coefficients stand in door_proposals.py."""
    from sklearn.linear_model import LogisticRegression

    pairs = [pair for sample in samples for pair in sample.found]
    if len({hit is not None for _, hit in pairs}) < 2:
        print("no regression: it takes right and wrong proposals")
        return
    features = np.array([[math.log(p.recess / math.hypot(p.rough, SMOOTH)), p.seen] for p, _ in pairs])
    model = LogisticRegression(C=10.0).fit(features, [hit is not None for _, hit in pairs])
    per_contrast, per_seen = model.coef_[0]
    print(f"intercept {model.intercept_[0]:.2f}, per log(contrast) {per_contrast:.2f}, per seen {per_seen:.2f}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folders", nargs="+", type=Path)
    parser.add_argument("--tolerance", type=float, default=0.3, help="how far a proposal's middle may be off [m]")
    parser.add_argument("--fit", action="store_true")
    parser.add_argument("--misses", action="store_true", help="list the wrong and the missing ones at 0.5")
    parser.add_argument("--quick", action="store_true", help=f"the first {QUICK} maps of each folder")
    options = parser.parse_args()
    for folder in options.folders:
        paths = sorted(p.parent for p in folder.rglob("map.yaml") if (p.parent / "doors.geojson").exists())
        paths = paths[: QUICK if options.quick else None]
        samples = [measure(path, options.tolerance) for path in paths]
        if options.fit:
            fit(samples[::2])
        print_table(f"{folder.name}, tuned half", samples[::2])
        print_table(f"{folder.name}, held-out half", samples[1::2])
        if options.misses:
            for sample in samples:
                wrong = [f"({p.midpoint[0]:.1f}, {p.midpoint[1]:.1f}) {p.score:.2f}" for p, hit in sample.found
                         if hit is None and p.score >= 0.5]  # fmt: skip
                right = sum(hit is not None and p.score >= 0.5 for p, hit in sample.found)
                print(f"{sample.name}: {right} of {sample.doors}; wrong: {', '.join(wrong) or 'none'}")


if __name__ == "__main__":
    main()
