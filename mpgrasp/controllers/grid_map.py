"""World cells that fuse the grasp maps of many views (eq. 6-9).

Each cell counts what was seen inside it: how often which quality, and which quality together with which
angle. Reference: Morrison et al., Multi-View Picking, ICRA 2019, whose grid this is. By default it is the
published one: the mean quality is that of observations and prior, so that a cell that was hardly seen has a
mean near 0.5 and beats an object that is claimed weakly; cells of the border are never the best; width and
surface height are plain means (eq. 9). One thing differs from the published code: points outside of the
grid are dropped, where that code clips them onto the border's cells.

`ROBUST_GRID` is this project's own: the mean is that of the observations alone; a cell's rank grows with
the number of its observations, so that a cell that was hardly seen is never the best; and width and height
are weighted by quality (the paper's text under eq. 7 asks for it), because a detector says nothing useful
about the width where it sees no grasp, and a cell at an object's edge also holds points of the table.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from mpgrasp.exceptions import ConfigError
from mpgrasp.geometry import FloatArray, wrap_half_pi
from mpgrasp.grasp import Grasp, GraspMap, image_to_world_angle
from mpgrasp.linear_algebra import dot, product
from mpgrasp.workspace import WORKSPACE_CENTRE

EXTENT_AS_WRITTEN = 0.68
"""Edge of the grid, Table I taken by its unit: "68 cm" [m]."""
EXTENT_PUBLISHED = 0.34
"""Edge of the grid in published multi-view picking code: 68 cells of 5 mm [m]."""


@dataclass(frozen=True, kw_only=True)
class GridConfig:
    """The grid map of Table I."""

    cell: float = 0.005
    """Edge u of a cell [m]."""
    extent: float = EXTENT_AS_WRITTEN
    """Edge of the square grid [m]; J = K = extent / cell."""
    centre: tuple[float, float] = WORKSPACE_CENTRE
    """World x and y of the grid's centre [m]."""
    n_quality: int = 10
    """N_q, bins of the quality in [0, 1]."""
    n_angle: int = 18
    """N_theta, bins of the angle in [-pi/2, pi/2)."""
    z_floor: float = -0.01
    """Points lower than this are noise [m]; a little below the table, or half of its points would go."""
    z_ceiling: float = 0.17
    """Points higher than this are noise [m]."""
    prior_count: float = 1.0
    """Count that every (angle, quality) bin starts with: it makes unseen cells the most uncertain ones."""
    prior_in_mean: bool = True
    """True if the mean quality includes the prior, as in published code; False for the observations alone."""
    evidence: float = 0.0
    """Observations after which a cell's mean quality counts half in the search for the best cell; three
    views from the start height bring about 20. 0 ranks by the mean alone, as published code does."""
    border_counts: bool = False
    """True if a cell on the border can be the best one; False, as in published code, if its mean is 0."""
    weighted: bool = False
    """True if a cell's width and surface height are means weighted by quality, False for plain means."""
    filled_counts: bool = False
    """True if pixels without a return, whose depth the detector filled in, count as seen."""
    failure_sigma: float = 0.0075
    """Radius (1 sigma) around a failed grasp within which quality is lowered [m]."""

    def __post_init__(self) -> None:
        if not 0 < self.cell <= self.extent:
            raise ConfigError("unusable grid", got=(self.cell, self.extent), allowed="0 < cell <= extent [m]")
        if self.n_quality < 2 or self.n_angle < 2:
            raise ConfigError("too few bins", got=(self.n_quality, self.n_angle), allowed="2 or more each")
        if self.z_floor >= self.z_ceiling:
            raise ConfigError("floor above ceiling", got=self.z_floor, allowed=f"below {self.z_ceiling}")
        if not (self.evidence >= 0 and self.failure_sigma > 0 and self.prior_count >= 0):
            raise ConfigError(
                "unusable grid weights",
                got=(self.evidence, self.failure_sigma, self.prior_count),
                allowed="evidence >= 0, failure_sigma > 0, prior_count >= 0",
            )

    @property
    def shape(self) -> tuple[int, int]:
        """(ny, nx) cells."""
        n = max(1, round(self.extent / self.cell))
        return n, n


ROBUST_GRID = GridConfig(
    prior_in_mean=False, evidence=20.0, border_counts=True, weighted=True, filled_counts=False
)
"""Settings of this project's grid; see the module's first lines."""


@dataclass(eq=False)
class GridMap:
    """Histograms over the workspace; row = y, column = x, cell (0, 0) at the smallest x and y."""

    config: GridConfig = field(default_factory=GridConfig)

    def __post_init__(self) -> None:
        c = self.config
        ny, nx = c.shape
        self.x0 = c.centre[0] - nx * c.cell / 2
        self.y0 = c.centre[1] - ny * c.cell / 2
        self.quality_counts: NDArray[np.float32] = np.zeros((ny, nx, c.n_quality), np.float32)
        """q of the paper: observations per quality bin, without prior."""
        self.counts: NDArray[np.float32] = np.zeros((ny, nx, c.n_angle, c.n_quality), np.float32)
        """m of the paper: observations per angle and quality bin, without prior."""
        self.failures: NDArray[np.float32] = np.zeros((ny, nx), np.float32)
        """By how much quality is lowered after failed grasps."""
        self._weight = np.zeros(ny * nx)
        self._weighted_width = np.zeros(ny * nx)
        self._weighted_height = np.zeros(ny * nx)
        self.touched: NDArray[np.intp] = np.zeros(0, np.intp)
        """(n,) flat indices of the cells into which pixels of the last view fell, rising."""
        self._fresh: tuple[FloatArray, FloatArray] | None = None  # observations and mean quality
        self._stale: list[NDArray[np.intp]] = []  # cells that have changed since

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns (ny, nx)."""
        return self.config.shape

    @property
    def quality_centres(self) -> FloatArray:
        """(n_q,) what an observation in each bin is worth: the bin's centre.

        Eq. 7 writes n_q / N_q, the upper edge, which overrates everything by half a bin.
        """
        return (np.arange(self.config.n_quality) + 0.5) / self.config.n_quality

    @property
    def angle_centres(self) -> FloatArray:
        """(n_theta,) centre of each angle bin [rad]."""
        return (np.arange(self.config.n_angle) + 0.5) / self.config.n_angle * np.pi - np.pi / 2

    def axes(self) -> tuple[FloatArray, FloatArray]:
        """World x (nx,) and y (ny,) of the cell centres [m]."""
        ny, nx = self.shape
        u = self.config.cell
        return self.x0 + (np.arange(nx) + 0.5) * u, self.y0 + (np.arange(ny) + 0.5) * u

    def position(self, cell: tuple[int, int]) -> FloatArray:
        """World (x, y) of a cell's centre [m]."""
        u = self.config.cell
        return np.array([self.x0 + (cell[1] + 0.5) * u, self.y0 + (cell[0] + 0.5) * u])

    def update(self, grasp_map: GraspMap) -> NDArray[np.intp]:
        """Add every pixel of a view and return its flat cell index (H, W), -1 where it was dropped.

        Dropped are pixels without depth, outside of the grid, above the ceiling or below the floor.
        """
        c = self.config
        cells, z = self._locate(grasp_map)
        seen = np.flatnonzero(cells >= 0)
        index, z = cells.take(seen), z.take(seen)
        quality = np.clip(grasp_map.quality.take(seen), 0.0, 1.0)
        q_bin = np.minimum((quality * c.n_quality).astype(np.intp), c.n_quality - 1)
        # the camera looks down, so that world angle = image angle + heading of the image's u axis
        heading = image_to_world_angle(0.0, grasp_map.T_world_camera)
        turns = grasp_map.angle.take(seen) / np.float32(np.pi) + np.float32(heading / np.pi + 0.5)
        angle_bin = np.minimum(((turns - np.floor(turns)) * c.n_angle).astype(np.intp), c.n_angle - 1)
        width = grasp_map.width.take(seen) * grasp_map.depth.take(seen) / np.float32(grasp_map.intrinsics.fx)

        ones = np.float32(1.0)
        np.add.at(self.quality_counts.reshape(-1), index * c.n_quality + q_bin, ones)
        np.add.at(self.counts.reshape(-1), (index * c.n_angle + angle_bin) * c.n_quality + q_bin, ones)
        n = self._weight.size
        counts = np.bincount(index, minlength=n)
        self._weight += np.bincount(index, weights=quality, minlength=n) if c.weighted else counts
        if c.weighted:
            width, z = width * quality, z * quality
        self._weighted_width += np.bincount(index, weights=width, minlength=n)
        self._weighted_height += np.bincount(index, weights=z, minlength=n)
        self.touched = np.flatnonzero(counts)
        self._stale.append(self.touched)
        return cells

    def _locate(self, grasp_map: GraspMap) -> tuple[NDArray[np.intp], NDArray[np.float32]]:
        """Flat cell index (H, W), -1 where the point is dropped, and world z (H, W) [m]."""
        c, k = self.config, grasp_map.intrinsics
        ny, nx = self.shape
        R, t = grasp_map.T_world_camera[:3, :3], grasp_map.T_world_camera[:3, 3]
        a = (np.arange(k.width) - k.cx) / k.fx  # (W,)
        b = ((np.arange(k.height) - k.cy) / k.fy)[:, None]  # (H, 1)
        # single precision: 1e-7 of a metre is far below the sensor's noise
        x, y, z = (
            grasp_map.depth * ((R[i, 0] * a).astype(np.float32) + (R[i, 1] * b + R[i, 2]).astype(np.float32))
            + np.float32(t[i])
            for i in range(3)
        )
        with np.errstate(invalid="ignore"):
            col = np.floor((x - np.float32(self.x0)) * np.float32(1 / c.cell))
            row = np.floor((y - np.float32(self.y0)) * np.float32(1 / c.cell))
            # comparisons with NaN are false: pixels without depth drop out here
            seen = (col >= 0) & (col < nx) & (row >= 0) & (row < ny) & (z >= c.z_floor) & (z <= c.z_ceiling)
            seen &= np.isfinite(grasp_map.quality + grasp_map.angle + grasp_map.width)
            if grasp_map.measured is not None and not c.filled_counts:
                seen &= grasp_map.measured
            row *= nx
            row += col
            row[~seen] = -1
            cells = row.astype(np.intp)
        return cells, z

    def observations(self) -> FloatArray:
        """(ny, nx) points seen in each cell."""
        return self._summary()[0]

    def mean_quality(self) -> FloatArray:
        """Mean quality (ny, nx), eq. 7, less the part that failures took; 0 where unseen."""
        return self._summary()[1]

    def _summary(self) -> tuple[FloatArray, FloatArray]:
        """Observations and mean quality, (ny, nx) each; of the cells that no view has changed, as before."""
        if self._fresh is None:
            self._fresh = (np.zeros(self.shape, np.float32),) * 2
            self._stale = [np.arange(self._weight.size)]
        if self._stale:
            cells = self._stale[0] if len(self._stale) == 1 else np.unique(np.concatenate(self._stale))
            n, mean = (known.copy() for known in self._fresh)
            n.reshape(-1)[cells], mean.reshape(-1)[cells] = self._summary_of(cells)
            if not self.config.border_counts:
                mean[[0, -1], :] = 0
                mean[:, [0, -1]] = 0
            self._fresh, self._stale = (n, mean), []
        return self._fresh

    def _summary_of(self, cells: NDArray[np.intp]) -> tuple[FloatArray, FloatArray]:
        """Observations (n,) in cells (n,), and their mean quality (n,)."""
        counts = self.quality_counts.reshape(-1, self.config.n_quality).take(cells, axis=0)
        n = np.einsum("cq->c", counts)
        total = np.einsum("cq,q->c", counts, self.quality_centres.astype(np.float32))
        mean = total / np.maximum(n, 1)
        if self.config.prior_in_mean:
            # the same count in every bin: their mean is 0.5
            prior = np.float32(self.config.prior_count * self.config.n_angle * self.config.n_quality)
            mean = np.where(n > 0, (total + prior / 2) / np.maximum(n + prior, 1), 0)
        return n, np.clip(mean - self.failures.take(cells), 0.0, 1.0)

    def mean_angle(self, cell: tuple[int, int]) -> float:
        """Mean closing direction of a cell [rad], eq. 8, weighted by quality.

        Angles are doubled before averaging (a grasp is the same after half a turn); eq. 8 as printed
        would make 0 out of -89 and +89 degrees.
        """
        weight = product(self.counts[cell], self.quality_centres)  # (n_theta,)
        s, c = dot(weight, np.sin(2 * self.angle_centres)), dot(weight, np.cos(2 * self.angle_centres))
        return float(wrap_half_pi(np.arctan2(s, c) / 2))

    def mean_width(self, cell: tuple[int, int]) -> float:
        """Mean opening of a cell [m], eq. 9; 0 where there is nothing to take a mean of."""
        return self._weighted_mean(self._weighted_width, cell)

    def mean_height(self, cell: tuple[int, int]) -> float:
        """Mean surface height of a cell [m]; 0 where there is nothing to take a mean of."""
        return self._weighted_mean(self._weighted_height, cell)

    def _weighted_mean(self, total: FloatArray, cell: tuple[int, int]) -> float:
        flat = cell[0] * self.shape[1] + cell[1]
        return float(total[flat] / self._weight[flat]) if self._weight[flat] > 0 else 0.0

    def best_cell(self) -> tuple[int, int] | None:
        """Return the cell of the highest mean quality, weighted by evidence (see `GridConfig.evidence`).

        None where there is no such cell. Without the prior in its mean, that is also a map in which every
        observation fell into the lowest quality bin.
        """
        n, quality = self._summary()
        rank = quality * n / np.maximum(n + self.config.evidence, 1)
        if not self.config.prior_in_mean:
            rank[self.quality_counts[..., 0] >= n] = 0.0
        best = np.unravel_index(np.argmax(rank), rank.shape)
        return (int(best[0]), int(best[1])) if rank[best] > 0 else None

    def grasp(self, cell: tuple[int, int]) -> Grasp:
        """The grasp of a cell, eq. 6: at its centre, on its mean surface, with its mean angle and width."""
        return Grasp(
            position=np.array([*self.position(cell), self.mean_height(cell)]),
            angle=self.mean_angle(cell),
            width=self.mean_width(cell),
            quality=float(self.mean_quality()[cell]),
        )

    def best_grasp(self) -> Grasp | None:
        """The grasp of the best cell, or None where no grasp was seen."""
        cell = self.best_cell()
        return None if cell is None else self.grasp(cell)

    def suppress(self, position: FloatArray) -> None:
        """Lower quality around a failed grasp at world (x, y[, z]) [m]; earlier failures fade by half."""
        self._fresh = None
        x, y = self.axes()
        squared = (x - position[0]) ** 2 + ((y - position[1]) ** 2)[:, None]  # (ny, nx)
        bump = np.exp(-0.5 * squared / self.config.failure_sigma**2)
        self.failures = (0.5 * self.failures + 0.5 * bump).astype(np.float32)
