"""Compiled kernels for serving the transformers, where numpy has no single call: norms and attention over few tokens.
Arrays are float32 and C-contiguous.
"""

import math

import numpy as np

from overcooked.compiled import njit

# Sums may be reordered, so that they can be vectorised; NaN and infinity keep their meaning.
_kernel = njit(cache=True, error_model="numpy", fastmath={"reassoc", "contract", "arcp", "nsz"})
_NORM_EPSILON = 1e-5


def warm() -> None:
    """Load the compiled code of the stream form, with arrays such as it gives."""
    ones = np.ones((1, 2), np.float32)
    norm(ones, ones[0], ones[0])
    token = np.zeros(1, np.int64)
    rings = np.ones((1, 1, 2, 1), np.float32), np.ones((1, 1, 1, 2), np.float32)
    cached_attention(np.ones((1, 3, 1, 2), np.float32), *rings, token, token, ones[:, :1], ones[:, :1])


@_kernel
def norm(x, weight, bias):
    """Return the layer norm of each row of `x` (rows, hidden)."""
    rows, hidden = x.shape
    out = np.empty_like(x)
    for row in range(rows):
        total = np.float32(0)
        for k in range(hidden):
            total += x[row, k]
        mean = total / np.float32(hidden)
        squares = np.float32(0)
        for k in range(hidden):
            away = x[row, k] - mean
            squares += away * away
        scale = np.float32(1) / np.float32(math.sqrt(squares / np.float32(hidden) + np.float32(_NORM_EPSILON)))
        for k in range(hidden):
            out[row, k] = (x[row, k] - mean) * scale * weight[k] + bias[k]
    return out


@_kernel
def cached_attention(qkv, keys, values, slots, timesteps, cosine, sine):
    """Let one new token per game attend to itself and to the cached tokens; add its key and value to the cache.

    `qkv` (games, 3, heads, dim), `keys` (slots, heads, dim, look_back), `values` (slots, heads, look_back, dim): rings
    over the timesteps, each read from front to back, as most of them are no longer in the processor's caches. `cosine`,
    `sine` (games, dim / 2): the rotation of each game's timestep. Gives (games, heads * dim).
    """
    games, _, heads, dim = qkv.shape
    kept, half = keys.shape[3], dim // 2
    seen = np.zeros((games, heads * dim), np.float32)
    query = np.empty(dim, np.float32)
    weights = np.empty(kept, np.float32)
    scale = np.float32(1 / math.sqrt(dim))
    for game in range(games):
        slot, now = slots[game], timesteps[game]
        place, count = now % kept, min(now + 1, kept)
        for head in range(heads):
            for k in range(half):
                c, s = cosine[game, k], sine[game, k]
                first, second = qkv[game, 0, head, k], qkv[game, 0, head, k + half]
                query[k], query[k + half] = (first * c - second * s) * scale, (first * s + second * c) * scale
                first, second = qkv[game, 1, head, k], qkv[game, 1, head, k + half]
                keys[slot, head, k, place] = first * c - second * s
                keys[slot, head, k + half, place] = first * s + second * c
            for k in range(dim):
                values[slot, head, place, k] = qkv[game, 2, head, k]
            weights[:] = 0
            for k in range(dim):
                for past in range(kept):  # all places: those beyond `count` are not looked at below
                    weights[past] += query[k] * keys[slot, head, k, past]
            _soften(weights, count)
            for past in range(count):
                for k in range(dim):
                    seen[game, head * dim + k] += weights[past] * values[slot, head, past, k]
    return seen


@_kernel
def window_attention(qkv, present, first_query):
    """Let every token from `first_query` on attend to the last `present` (games,) tokens of its game, itself among
    them.

    `qkv` (games, tokens, 3, heads, dim). Gives (games, tokens - first_query, heads * dim); zero for absent tokens.
    """
    games, tokens, _, heads, dim = qkv.shape
    seen = np.zeros((games, tokens - first_query, heads * dim), np.float32)
    weights = np.empty(tokens, np.float32)
    scale = np.float32(1 / math.sqrt(dim))
    for game in range(games):
        begin = tokens - present[game]
        for head in range(heads):
            for token in range(max(begin, first_query), tokens):
                for other in range(begin, tokens):
                    score = np.float32(0)
                    for k in range(dim):
                        score += qkv[game, token, 0, head, k] * qkv[game, other, 1, head, k]
                    weights[other - begin] = score * scale
                _soften(weights, tokens - begin)
                for other in range(begin, tokens):
                    for k in range(dim):
                        share = weights[other - begin] * qkv[game, other, 2, head, k]
                        seen[game, token - first_query, head * dim + k] += share
    return seen


@njit(cache=True, error_model="numpy", inline="always")
def _soften(scores, count):
    """Apply softmax to the first `count` scores, in place."""
    most = scores[0]
    for k in range(1, count):
        most = max(most, scores[k])
    total = np.float32(0)
    for k in range(count):
        scores[k] = np.exp(scores[k] - most)
        total += scores[k]
    for k in range(count):
        scores[k] /= total
