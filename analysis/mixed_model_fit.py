"""Fit a linear model with one random intercept per person, exactly: a search along one line.

Given the ratio of the two variances (between people over within people), everything else has a closed form, so the
likelihood is a function of one number. It is evaluated on a grid that spans every ratio and then refined around the
best point; a gradient method in two dimensions stops too early.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import optimize

Array = NDArray[np.float64]
GRID = np.linspace(-14, 14, 57)  # logarithms of the ratio
NOTHING = 1e-12  # a variance that is this small a part of the whole is rounding
ROUNDING = 1e-9  # and so is a standard deviation that is this small a part of the largest value


class FitError(ValueError):
    """The model cannot be fitted; the message says why."""


@dataclass(frozen=True)
class Data:
    """y (episodes,), x (episodes, effects) and the person of each episode, 0 to people - 1."""

    y: Array
    x: Array
    person: NDArray[np.int64]

    @property
    def sizes(self) -> Array:
        """Episodes of each person."""
        return np.bincount(self.person).astype(np.float64)

    def sums(self, values: Array) -> Array:
        """Sums of (episodes, columns) over each person: (people, columns)."""
        found = np.zeros((int(self.person.max()) + 1, values.shape[1]))
        np.add.at(found, self.person, values)
        return found


@dataclass(frozen=True)
class Fit:
    """The estimates. `log_likelihood` is of the kind that was maximised, restricted or not."""

    beta: Array
    covariance: Array  # of beta
    between: float  # variance between people
    within: float  # variance between episodes of one person
    log_likelihood: float
    residuals: Array  # without the fixed effects and the person's own predicted deviation
    _data: Data

    def degrees(self, weights: Array) -> float:
        """Satterthwaite's degrees of freedom of a weighted sum of beta, from the expected restricted information. In a
        balanced study they are the people minus the conditions."""
        variance = float(weights @ self.covariance @ weights)
        by_person = self._by_person()
        own = by_person.T @ by_person
        parts = (own, (np.linalg.inv(self.covariance) - self.between * own) / self.within)
        gradient = np.array([weights @ self.covariance @ part @ self.covariance @ weights for part in parts])
        spread = float(gradient @ np.linalg.solve(self._information(by_person), gradient))
        return 2 * variance**2 / spread

    def _by_person(self) -> Array:
        """Return Z'V^-1 X: (people, effects)."""
        sums = self._data.sums(self._data.x)
        return np.asarray(sums / (self.within + self.between * self._data.sizes)[:, None])

    def _information(self, by_person: Array) -> Array:
        """Return the expected restricted information about (between, within): half the traces of P V_i P V_j. Written
        with sums over people alone, by P V P = P."""
        sizes = self._data.sizes
        diagonal = sizes / (self.within + self.between * sizes)  # Z'V^-1 Z
        taken = np.einsum("pi,ij,pj->p", by_person, self.covariance, by_person)  # diagonal of what the effects take
        mixed = by_person.T @ by_person @ self.covariance
        trace = float(diagonal.sum() - taken.sum())
        square = float((diagonal**2).sum() - 2 * (diagonal * taken).sum() + np.trace(mixed @ mixed))
        whole = (len(self._data.y) - len(self.beta) - self.between * trace) / self.within  # tr P
        cross = (trace - self.between * square) / self.within  # tr P P ZZ'
        rest = (whole - self.between * cross) / self.within  # tr P P
        return 0.5 * np.array([[square, cross], [cross, rest]])


class Profile:
    """The log-likelihood along the ratio of variances."""

    def __init__(self, data: Data, restricted: bool) -> None:
        self.data, self.restricted = data, restricted
        self._sizes, self._sums = data.sizes, data.sums(data.x)
        self._xx = data.x.T @ data.x
        # The residuals of ordinary least squares have the same likelihood as y, without a large mean that costs digits.
        self._start = np.asarray(np.linalg.lstsq(data.x, data.y)[0], dtype=np.float64)
        self._rest = data.y - data.x @ self._start
        self._total, self._xy = data.sums(self._rest[:, None])[:, 0], data.x.T @ self._rest
        self.count = len(data.y) - (data.x.shape[1] if restricted else 0)

    def along(self, ratios: Array) -> Array:
        """Return the log-likelihood at many ratios at a time."""
        weights = ratios[:, None] / (1 + ratios[:, None] * self._sizes)  # (ratios, people)
        squares = np.einsum("pi,pj->pij", self._sums, self._sums).reshape(len(self._sums), -1)
        inner = self._xx - (weights @ squares).reshape(-1, *self._xx.shape)
        right = self._xy - (weights * self._total) @ self._sums
        beta = np.linalg.solve(inner, right[:, :, None])[:, :, 0]
        rest = self._total - beta @ self._sums.T  # (ratios, people)
        plain = self._rest @ self._rest - 2 * beta @ self._xy + np.einsum("ri,ij,rj->r", beta, self._xx, beta)
        scale = (plain - (weights * rest**2).sum(axis=1)) / self.count
        value = self.count * (np.log(2 * math.pi * scale) + 1)
        value += np.log1p(ratios[:, None] * self._sizes).sum(axis=1)
        if self.restricted:
            value += np.linalg.slogdet(inner)[1]
        return np.asarray(-0.5 * value)

    def solve(self, ratio: float) -> tuple[Array, Array, float]:
        """Return beta, the inverse of X'H^-1 X and the weighted residual sum of squares, H = I + ratio ZZ'."""
        weights = ratio / (1 + ratio * self._sizes)
        inner = self._xx - (self._sums * weights[:, None]).T @ self._sums
        right = self._xy - self._sums.T @ (weights * self._total)
        beta = np.asarray(np.linalg.solve(inner, right), dtype=np.float64)
        rest = self._total - self._sums @ beta
        plain = self._rest - self.data.x @ beta
        inverse = np.asarray(np.linalg.inv(inner), dtype=np.float64)
        return self._start + beta, inverse, float(plain @ plain - (weights * rest**2).sum())

    def __call__(self, ratio: float) -> float:
        """Return the log-likelihood at its maximum over everything but the ratio."""
        _, inverse, squares = self.solve(ratio)
        if squares <= 0:
            return -math.inf
        value = self.count * (math.log(2 * math.pi * squares / self.count) + 1)
        value += float(np.log1p(ratio * self._sizes).sum())
        if self.restricted:
            value -= float(np.linalg.slogdet(inverse)[1])
        return -0.5 * value


def fit(data: Data, restricted: bool = True) -> Fit:
    """Return the fit with the largest (restricted) likelihood. Raises FitError where there is none."""
    if np.linalg.matrix_rank(data.x) < data.x.shape[1]:
        raise FitError("two of its effects cannot be separated: not every condition was played alike")
    if len(data.y) - data.x.shape[1] < 2 or data.sizes.max() < 2:
        raise FitError("there are too few episodes for so many effects")
    total = float(data.y.var())
    profile = Profile(data, restricted)
    if math.sqrt(total) <= ROUNDING * np.abs(data.y).max() or profile.solve(0.0)[2] <= NOTHING * total * len(data.y):
        raise FitError("nothing varies apart from the effects")
    ratio = best_ratio(profile)
    beta, inverse, squares = profile.solve(ratio)
    within = squares / profile.count
    if within <= NOTHING * total:
        raise FitError("nothing varies between the episodes of a person")
    rest = data.y - data.x @ beta
    own = (ratio / (1 + ratio * data.sizes)) * data.sums(rest[:, None])[:, 0]
    return Fit(beta, inverse * within, ratio * within, within, profile(ratio), rest - own[data.person], data)


def best_ratio(profile: Profile) -> float:
    """Return the ratio at which the likelihood is largest, 0 included. Raises FitError if the search does not
    settle."""
    with np.errstate(all="ignore"):
        found = profile.along(np.exp(GRID))
    if not np.all(np.isfinite(found)):
        raise FitError("its likelihood cannot be computed")
    best = int(np.argmax(found))
    if best == len(GRID) - 1:
        raise FitError("nothing varies between the episodes of a person")
    bounds = (GRID[max(best - 1, 0)], GRID[best + 1])
    refined = optimize.minimize_scalar(
        lambda place: -profile(math.exp(place)), bounds=bounds, method="bounded", options={"xatol": 1e-9}
    )
    if not refined.success or not math.isfinite(refined.fun):
        raise FitError("the search for its variances did not converge")
    return 0.0 if profile(0.0) >= -refined.fun else math.exp(refined.x)
