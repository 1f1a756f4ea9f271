"""Fit a cumulative-link (proportional odds) model with one random intercept per person, by maximum likelihood.

P(answer <= k) = logistic(threshold_k - x beta - sd u), u standard normal for each person. Each person's integral over
u is taken by adaptive Gauss-Hermite quadrature about the mode; one node is Laplace's approximation (Liu and Pierce
1994). The logistic link makes the integrand log-concave, so that Newton's method finds the mode.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import optimize, special

Array = NDArray[np.float64]
NODES = 15
NEWTON_STEPS = 100
TOLERANCE = 1e-10
FLAT = 1e-3  # of the gradient at a maximum
STEP = 1e-4  # for the differences that give the curvature
MAX_LOG_ODDS = 15.0  # log odds beyond which answers are separated and there is no estimate


class OrdinalFitError(ValueError):
    """The model cannot be fitted; the message says why."""


@dataclass(frozen=True)
class OrdinalData:
    """category (answers,) 0 to categories - 1, x (answers, effects) without intercept, person (answers,) from 0."""

    category: NDArray[np.int64]
    x: Array
    person: NDArray[np.int64]

    @property
    def categories(self) -> int:
        return int(self.category.max()) + 1

    @property
    def people(self) -> int:
        return int(self.person.max()) + 1


@dataclass(frozen=True)
class OrdinalFit:
    """The estimates: log odds of a higher answer."""

    thresholds: Array
    beta: Array
    covariance: Array  # of beta
    person_sd: float
    log_likelihood: float


def fit(data: OrdinalData, nodes: int = NODES) -> OrdinalFit:
    """Maximise the likelihood. Raises OrdinalFitError."""
    if data.categories < 2:
        raise OrdinalFitError("all answers are the same")
    effects = np.column_stack([np.ones(data.category.size), data.x])
    if np.linalg.matrix_rank(effects) < effects.shape[1]:
        raise OrdinalFitError("some effects cannot be separated")

    def loss(values: Array) -> float:
        return -log_likelihood(data, values, nodes)[0]

    def slope(values: Array) -> Array:
        return -gradient(data, values, nodes)

    with np.errstate(over="ignore", invalid="ignore"):
        place = np.asarray(optimize.minimize(loss, _start(data), jac=slope, method="BFGS").x)
    thresholds, beta, sd = unpacked(data, place)
    if np.abs(beta).max(initial=0) > MAX_LOG_ODDS or np.abs(thresholds).max() > 3 * MAX_LOG_ODDS:
        raise OrdinalFitError("the answers of some conditions do not overlap with the others")
    value = loss(place)
    if not np.isfinite(value) or np.abs(slope(place)).max() > FLAT:
        raise OrdinalFitError("the search for the maximum did not end")
    covariance = _covariance(data, place, slope)
    if np.diag(covariance).max(initial=0) > MAX_LOG_ODDS**2:
        raise OrdinalFitError("the answers do not determine some effects")
    return OrdinalFit(thresholds, beta, covariance, abs(sd), -value)


def _start(data: OrdinalData) -> Array:
    """Return start values: thresholds as in the answers of all, no effects, people who differ a little."""
    counts = np.bincount(data.category, minlength=data.categories)
    cumulative = (np.cumsum(counts)[:-1] + 0.5) / (counts.sum() + 1)
    thresholds = special.logit(cumulative)
    steps = np.log(np.maximum(np.diff(thresholds), 1e-3))
    return np.concatenate([thresholds[:1], steps, np.zeros(data.x.shape[1]), [0.7]])


def unpacked(data: OrdinalData, values: Array) -> tuple[Array, Array, float]:
    """Return thresholds (first, then logarithms of the steps), beta and the standard deviation between people, which
    may be negative: the likelihood is the same."""
    cuts = data.categories - 1
    steps = np.exp(values[1:cuts])
    return np.cumsum(np.concatenate([values[:1], steps])), values[cuts:-1], float(values[-1])


@dataclass(frozen=True)
class _Nodes:
    """The values of the integrals at each node."""

    places: Array  # (nodes, people): values of u
    weights: Array  # (nodes, people): posterior weights, which sum to one over the nodes
    log_integral: Array  # (people,)


def log_likelihood(data: OrdinalData, values: Array, nodes: int) -> tuple[float, _Nodes]:
    """Return the logarithm of the likelihood, and the nodes that it was integrated with."""
    thresholds, beta, sd = unpacked(data, values)
    lower, upper = _bounds(data, thresholds)
    centre = data.x @ beta
    mode = np.zeros(data.people)
    for _ in range(NEWTON_STEPS):
        step = _newton(data, lower - centre, upper - centre, sd, mode)
        mode = mode + step[0]
        if np.abs(step[0]).max() < TOLERANCE:
            break
    spread = 1 / np.sqrt(_newton(data, lower - centre, upper - centre, sd, mode)[1])
    points, weights = np.polynomial.hermite.hermgauss(nodes)
    places = mode + np.sqrt(2) * spread * points[:, None]  # (nodes, people)
    shift = centre + sd * places[:, data.person]  # (nodes, answers)
    joint = _by_person(data, _log_probability(lower - shift, upper - shift)) - places**2 / 2
    logs = joint + (np.log(weights) + points**2)[:, None]
    total = special.logsumexp(logs, axis=0)
    integral = total + np.log(spread) - np.log(np.pi) / 2
    return float(integral.sum()), _Nodes(places, np.exp(logs - total), integral)


def _newton(data: OrdinalData, lower: Array, upper: Array, sd: float, mode: Array) -> tuple[Array, Array]:
    """Return Newton's step towards the mode of each person's u, and the negative curvature there. The step is damped as
    the logistic function allows (Bach 2010): a full step swings between two places far from the mode."""
    low, high = (special.expit(bound - sd * mode[data.person]) for bound in (lower, upper))
    slope = sd * _by_person(data, low + high - 1) - mode
    curvature = sd**2 * _by_person(data, low * (1 - low) + high * (1 - high)) + 1
    step = slope / curvature
    length = np.maximum(abs(sd) * np.abs(step), 1e-12)
    return step * np.log1p(length) / length, curvature


def _bounds(data: OrdinalData, thresholds: Array) -> tuple[Array, Array]:
    """Return the thresholds below and above each answer."""
    edges = np.concatenate([[-np.inf], thresholds, [np.inf]])
    return edges[data.category], edges[data.category + 1]


def _log_probability(lower: Array, upper: Array) -> Array:
    """Return log(logistic(upper) - logistic(lower)), also where both are far from zero."""
    return np.asarray(special.log_expit(upper) + special.log_expit(-lower) + np.log1p(-np.exp(lower - upper)))


def _by_person(data: OrdinalData, values: Array) -> Array:
    """Sums over the answers of each person, along the last axis."""
    if values.ndim == 1:
        return np.asarray(np.bincount(data.person, values, data.people), dtype=np.float64)
    return np.stack([np.bincount(data.person, row, data.people) for row in values])


def gradient(data: OrdinalData, values: Array, nodes: int) -> Array:
    """Return the gradient of the log likelihood. With one node it is computed by finite differences, because the mode
    moves with the parameters. Otherwise it is the mean of the complete data's gradient over u (Fisher's identity)."""
    if nodes == 1:
        return _differences(data, values)
    thresholds, beta, sd = unpacked(data, values)
    found = log_likelihood(data, values, nodes)[1]
    lower, upper = _bounds(data, thresholds)
    shift = data.x @ beta + sd * found.places[:, data.person]
    weights = found.weights[:, data.person]
    low, high = lower - shift, upper - shift
    slope = weights * (special.expit(low) + special.expit(high) - 1)  # of log p along x beta + sd u
    near = 1 / np.expm1(high - low)
    of_upper = (weights * (special.expit(-high) + near)).sum(axis=0)
    of_lower = -(weights * (special.expit(low) + near)).sum(axis=0)
    cuts = data.categories - 1
    of_cuts = np.bincount(data.category, of_upper, cuts + 1)[:-1] + np.bincount(data.category, of_lower, cuts + 1)[1:]
    of_steps = np.cumsum(of_cuts[::-1])[::-1]  # a step moves all thresholds after it
    of_steps[1:] *= np.exp(values[1:cuts])
    of_sd = (slope * found.places[:, data.person]).sum()
    return np.concatenate([of_steps, slope.sum(axis=0) @ data.x, [of_sd]])


def _differences(data: OrdinalData, values: Array) -> Array:
    """Return the gradient of Laplace's approximation by central differences."""
    steps = 1e-5 * np.eye(values.size)
    ahead, back = ([log_likelihood(data, values + sign * step, 1)[0] for step in steps] for sign in (1, -1))
    return np.asarray((np.array(ahead) - np.array(back)) / 2e-5)


def _covariance(data: OrdinalData, values: Array, slope: Callable[[Array], Array]) -> Array:
    """Return the inverse curvature of the negative log likelihood at its minimum, for beta."""
    rows = []
    for index in range(values.size):
        step = np.zeros(values.size)
        step[index] = STEP
        rows.append((slope(values + step) - slope(values - step)) / (2 * STEP))
    curvature = np.array(rows)
    curvature = (curvature + curvature.T) / 2
    try:
        np.linalg.cholesky(curvature)
        inverse = np.linalg.inv(curvature)
    except np.linalg.LinAlgError:
        raise OrdinalFitError("the likelihood is flat at its maximum") from None
    cuts = data.categories - 1
    return np.asarray(inverse[cuts:-1, cuts:-1])
