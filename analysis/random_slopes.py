"""Fit a linear model in which the intercept and further effects differ between people, by restricted likelihood.

The covariance of a person's own effects, as a multiple of the residual variance, is L L' with L lower triangular.
Given L everything else has a closed form from sums over each person; the search is over the entries of L.
"""

import math
from dataclasses import dataclass

import numpy as np
from scipy import optimize

from analysis.mixed_model_fit import Array, Data, FitError

STARTS = (0.3, 1.0)  # of the entries on L's diagonal


@dataclass(frozen=True)
class SlopesFit:
    """The estimates. `between`: covariance of people's own effects; `log_likelihood` is restricted."""

    beta: Array
    covariance: Array  # of beta
    between: Array
    within: float
    log_likelihood: float


class _Sums:
    """Z'Z, Z'X and Z'y of each person, of the residuals of ordinary least squares, without a large mean that costs
    digits."""

    def __init__(self, data: Data, own: Array) -> None:
        self.start = np.asarray(np.linalg.lstsq(data.x, data.y)[0], dtype=np.float64)
        y = data.y - data.x @ self.start
        people, size = int(data.person.max()) + 1, own.shape[1]
        self.zz, self.zx = np.zeros((people, size, size)), np.zeros((people, size, data.x.shape[1]))
        self.zy = np.zeros((people, size))
        np.add.at(self.zz, data.person, own[:, :, None] * own[:, None, :])
        np.add.at(self.zx, data.person, own[:, :, None] * data.x[:, None, :])
        np.add.at(self.zy, data.person, own * y[:, None])
        self.xx, self.xy, self.yy = data.x.T @ data.x, data.x.T @ y, float(y @ y)
        self.count = len(y) - data.x.shape[1]
        self.size = size

    def solve(self, values: Array) -> tuple[float, Array, Array, float]:
        """Return -2 log likelihood, beta, the inverse of X'H^-1 X and the residual variance, H = I + Z L L' Z'."""
        root = np.zeros((self.size, self.size))
        root[np.tril_indices(self.size)] = values
        inner = np.eye(self.size) + root.T @ self.zz @ root  # (people, size, size)
        rx, ry = root.T @ self.zx, (root.T @ self.zy[:, :, None])[:, :, 0]
        taken = np.linalg.solve(inner, np.concatenate([rx, ry[:, :, None]], axis=2))
        xx = self.xx - np.einsum("pki,pkj->ij", rx, taken[:, :, :-1])
        xy = self.xy - np.einsum("pki,pk->i", rx, taken[:, :, -1])
        beta = np.linalg.solve(xx, xy)
        within = float(self.yy - np.einsum("pk,pk->", ry, taken[:, :, -1]) - beta @ xy) / self.count
        if within <= 0:
            return math.inf, beta, xx, within
        value = self.count * (math.log(2 * math.pi * within) + 1)
        value += float(np.linalg.slogdet(inner)[1].sum()) + float(np.linalg.slogdet(xx)[1])
        return value, beta, np.linalg.inv(xx), within


def fit(data: Data, own: Array) -> SlopesFit:
    """Fit data.y ~ data.x with effects of the columns `own` (episodes, size) that differ between people. Raises
    FitError."""
    if np.linalg.matrix_rank(data.x) < data.x.shape[1]:
        raise FitError("two of its effects cannot be separated: not every condition was played alike")
    sums = _Sums(data, own)
    if sums.count < 2 or sums.yy <= 1e-12 * max(1.0, float(data.y @ data.y)):
        raise FitError("nothing varies apart from the effects")
    best = min((_search(sums, start) for start in STARTS), key=lambda entries: sums.solve(entries)[0])
    value, beta, inverse, within = sums.solve(best)
    if not math.isfinite(value):
        raise FitError("the search for its variances did not converge")
    root = np.zeros((sums.size, sums.size))
    root[np.tril_indices(sums.size)] = best
    return SlopesFit(sums.start + beta, inverse * within, root @ root.T * within, within, -value / 2)


def _search(sums: _Sums, start: float) -> Array:
    """Return the entries of L with the largest likelihood from a start."""

    def loss(values: Array) -> float:
        return sums.solve(values)[0]

    values: Array = np.eye(sums.size)[np.tril_indices(sums.size)] * start
    rough: Array = np.asarray(optimize.minimize(loss, values, method="Nelder-Mead", options={"maxiter": 2000}).x)
    fine: Array = np.asarray(optimize.minimize(loss, rough, method="BFGS").x)
    return min(rough, fine, key=loss)
