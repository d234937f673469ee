"""The network of the method ``learned``: from a patch to the sides of the room behind its door, and to its cells.

Only layers that OpenCV's ``dnn`` runs: strided convolutions, sums, nearest neighbours, means and maxima.
"""

import torch
from torch import Tensor, nn

from closedrooms.predictor.learned.patches import CHANNELS

# Columns and rows are told in groups of so many.
PARTS = 4
# Channels at a quarter of the resolution of a patch, an eighth, a sixteenth.
WIDTHS = (32, 64, 128)


class _Convolution(nn.Sequential):  # type: ignore[misc]
    """Convolution, normalisation, rectifier."""

    def __init__(self, inputs: int, outputs: int, size: int = 3, stride: int = 1, padding: int = 1) -> None:
        convolution = nn.Conv2d(inputs, outputs, size, stride, padding, bias=False)
        super().__init__(convolution, nn.BatchNorm2d(outputs), nn.ReLU(inplace=True))


class _Residual(nn.Module):  # type: ignore[misc]
    """Two convolutions beside a shortcut."""

    def __init__(self, width: int) -> None:
        super().__init__()
        last = nn.Conv2d(width, width, 3, padding=1, bias=False)
        self.way = nn.Sequential(_Convolution(width, width), last, nn.BatchNorm2d(width))

    def forward(self, x: Tensor) -> Tensor:
        return torch.relu(x + self.way(x))


class _Profile(nn.Module):  # type: ignore[misc]
    """Layers from features to a number for each part of every column, or of every row."""

    def __init__(self, width: int, *, columns: bool) -> None:
        super().__init__()
        self.across = 2 if columns else 3
        size, padding = ((1, 7), (0, 3)) if columns else ((7, 1), (3, 0))
        self.way = nn.Sequential(
            nn.Conv2d(2 * width, width, size, padding=padding),
            nn.ReLU(inplace=True),
            nn.Conv2d(width, PARTS, size, padding=padding),
        )

    def forward(self, x: Tensor) -> Tensor:
        pooled = torch.cat((x.mean(dim=self.across, keepdim=True), x.amax(dim=self.across, keepdim=True)), dim=1)
        return self.way(pooled).flatten(2)


class RoomNetwork(nn.Module):  # type: ignore[misc]
    """U-shaped network from patches to rooms.

    Takes patches of shape (n, 5, 128, 128). Returns logits: of the cells to be in the room, (n, 1, 128, 128); of the
    columns to hold a side of it, (n, 4, 32); of the rows to hold its back, (n, 4, 32). Number ``k`` of group ``g`` is
    cell ``4 g + k``.
    """

    def __init__(self) -> None:
        super().__init__()
        a, b, c = WIDTHS
        self.to_quarter = nn.Sequential(
            _Convolution(len(CHANNELS), a, size=PARTS, stride=PARTS, padding=0), _Residual(a)
        )
        self.to_eighth = nn.Sequential(_Convolution(a, b, stride=2), _Residual(b))
        self.to_sixteenth = nn.Sequential(_Convolution(b, c, stride=2), _Residual(c), _Residual(c))
        self.narrow = nn.ModuleList([nn.Conv2d(wide, slim, 1) for wide, slim in ((c, b), (b, a))])
        self.join = nn.ModuleList([_Convolution(width, width) for width in (b, a)])
        self.mask = nn.ConvTranspose2d(a, 1, PARTS, stride=PARTS)
        self.columns, self.rows = _Profile(a, columns=True), _Profile(a, columns=False)

    def forward(self, patches: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """Compute the logits of cells, columns and rows."""
        near = self.to_quarter(patches)
        wide = self.to_eighth(near)
        x = self.to_sixteenth(wide)
        for narrow, join, skip in zip(self.narrow, self.join, (wide, near), strict=True):
            x = join(nn.functional.interpolate(narrow(x), scale_factor=2.0, mode="nearest") + skip)
        return self.mask(x), self.columns(x), self.rows(x)
