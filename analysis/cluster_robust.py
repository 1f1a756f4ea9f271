"""Least squares with errors that are robust to clusters, with the small-sample correction of Bell and McCaffrey (CR2).

Plain cluster-robust errors (CR1) with the clusters minus one as degrees of freedom reject too often with few people:
a fifth of the time with six people of three conditions. CR2 divides out how far least squares bends to each cluster,
and takes Satterthwaite's degrees of freedom for each comparison (Pustejovsky and Tipton 2018). Both assume, for the
correction only, that the episodes are independent and vary alike.
"""

from dataclasses import dataclass

import numpy as np

from analysis import mixed_model_fit
from analysis.mixed_model_fit import Array, Data, FitError

SINGULAR = 1e-10  # eigenvalues below this share are 0: an effect that a single person determines


@dataclass(frozen=True)
class ClusterRobust:
    """The estimates, and the adjusted effects of each person that errors and degrees of freedom come from."""

    beta: Array
    inverse: Array  # of X'X
    scores: Array  # (people, effects): X'A e of each person
    bent: Array  # (people, effects, effects): X'A X of each person
    plain: Array  # (people, effects, effects): X'A A X of each person

    def estimate(self, weights: Array) -> tuple[float, float, float]:
        """Return the weighted sum of effects, its standard error and degrees of freedom."""
        along = self.inverse @ weights
        variance = float(((self.scores @ along) ** 2).sum())
        bent = self.bent @ along  # (people, effects)
        shared = np.diag(np.einsum("i,pij,j->p", along, self.plain, along)) - bent @ self.inverse @ bent.T
        df = float(np.trace(shared) ** 2 / (shared**2).sum())
        return float(weights @ self.beta), float(np.sqrt(variance)), df


def fit(data: Data) -> ClusterRobust:
    """Fit data.y ~ data.x by least squares with people as clusters. Raises FitError."""
    if np.linalg.matrix_rank(data.x) < data.x.shape[1]:
        raise FitError("two of its effects cannot be separated: not every condition was played alike")
    if np.ptp(data.y) <= mixed_model_fit.ROUNDING * np.abs(data.y).max():
        raise FitError("nothing varies apart from the effects")
    inverse = np.asarray(np.linalg.inv(data.x.T @ data.x), dtype=np.float64)
    beta = inverse @ data.x.T @ data.y
    rest = data.y - data.x @ beta
    parts = [_adjusted(data.x[data.person == person], rest[data.person == person], inverse) for person in _people(data)]
    scores, bent, plain = (np.stack(part) for part in zip(*parts, strict=True))
    return ClusterRobust(np.asarray(beta), inverse, scores, bent, plain)


def _people(data: Data) -> range:
    return range(int(data.person.max()) + 1)


def _adjusted(x: Array, rest: Array, inverse: Array) -> tuple[Array, Array, Array]:
    """Return X'A e, X'A X and X'A A X of one person, where A is the inverse root of what least squares leaves of its
    errors."""
    values, vectors = np.linalg.eigh(np.eye(len(x)) - x @ inverse @ x.T)
    kept = values > SINGULAR
    root = (vectors[:, kept] / np.sqrt(values[kept])) @ vectors[:, kept].T
    turned = root @ x
    return turned.T @ rest, turned.T @ x, turned.T @ turned
