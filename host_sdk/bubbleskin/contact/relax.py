"""Down to the nearest equilibrium: Newton steps by conjugate gradients, within a trust region, compiled.

Steihaug's method (1983): conjugate gradients on H s = −g, g the gradient and H the second derivatives of the energy,
preconditioned by each bubble's own 4 by 4 block, until the residual is small enough, the step leaves the trust region, or
the curvature is negative: then the step follows that direction to the region's edge. So a saddle is left downhill, a step
never raises the energy, and work is linear in contacts. Names of one letter are the method's: s the step, d its direction,
r the residual, z the preconditioned residual, E the energy.
"""

import inspect
import math
import zlib
from typing import NamedTuple

import numpy as np

from bubbleskin.contact import energy
from bubbleskin.contact.energy import curvature, gradient, hessian, membrane
from bubbleskin.membrane import balloon, wall
from bubbleskin.native import njit

CONVERGED, STALLED, EXHAUSTED, BURST = range(4)
"""How a relaxation ends: force below tolerance; no step helps; too many steps; a bubble grows without end or closes."""

_ROUNDING = 1e-14  # Share of the energy: below that, the forces decide whether a step is good.
_LARGEST, _SMALLEST = 10.0, 0.4  # Stretches of the outer radius between which the model is followed.
_LEAST_TRUST = 1e-13  # m. No step that short helps any more.
_IN_RANGE, _CLOSES, _GROWS = range(3)


class Curvature(NamedTuple):
    """H at one state, as `energy.curvature` prepares it: what a product H v needs, and its preconditioner."""

    pairs: np.ndarray
    """(m, 2)."""
    blocks: np.ndarray
    """(n, 4, 4): H of each bubble by itself."""
    contacts: np.ndarray
    """(m, 5)."""
    inverses: np.ndarray
    """(n, 4, 4): of the blocks' positive parts."""


@njit
def invert(blocks, inverses):  # type: ignore[no-untyped-def]
    """Inverse of each block's positive part, (n, 4, 4) each, by Cholesky with pivots held up."""
    L = np.zeros((4, 4))
    y = np.zeros(4)
    for i in range(len(blocks)):
        _factorise(blocks[i], L)
        for column in range(4):
            for a in range(4):
                total = 1.0 if a == column else 0.0
                for c in range(a):
                    total -= L[a, c] * y[c]
                y[a] = total / L[a, a]
            for a in range(3, -1, -1):
                total = y[a]
                for c in range(a + 1, 4):
                    total -= L[c, a] * inverses[i, c, column]
                inverses[i, a, column] = total / L[a, a]


@njit
def _factorise(block, L):  # type: ignore[no-untyped-def]
    """Cholesky factor `L` of `block`, no pivot below a thousandth of the largest."""
    floor = 1e-3 * max(abs(block[0, 0]), abs(block[1, 1]), abs(block[2, 2]), abs(block[3, 3]))
    for a in range(4):
        for b in range(a):
            total = block[a, b]
            for c in range(b):
                total -= L[a, c] * L[b, c]
            L[a, b] = total / L[b, b]
        total = block[a, a]
        for c in range(a):
            total -= L[a, c] * L[a, c]
        L[a, a] = math.sqrt(max(total, floor))


@njit
def precondition(inverses, r, z):  # type: ignore[no-untyped-def]
    """`z` = the inverted blocks times `r`, both (n, 4)."""
    for i in range(len(r)):
        for a in range(4):
            row = inverses[i, a]
            z[i, a] = row[0] * r[i, 0] + row[1] * r[i, 1] + row[2] * r[i, 2] + row[3] * r[i, 3]


@njit
def inner(a, b):  # type: ignore[no-untyped-def]
    """Sum of a b, (n, 4) each."""
    total = 0.0
    for i in range(len(a)):
        for k in range(4):
            total += a[i, k] * b[i, k]
    return total


# Loops instead of numpy's expressions: what they do when shapes differ, which they never do here, takes 25 s to compile.


@njit
def put(to, factor, a):  # type: ignore[no-untyped-def]
    """`to` = `factor` `a`, (n, 4) each."""
    for i in range(len(a)):
        for k in range(4):
            to[i, k] = factor * a[i, k]


@njit
def add(to, factor, a):  # type: ignore[no-untyped-def]
    """`to` += `factor` `a`, (n, 4) each."""
    for i in range(len(a)):
        for k in range(4):
            to[i, k] += factor * a[i, k]


@njit
def largest(a):  # type: ignore[no-untyped-def]
    """The largest size of an entry of `a`, (n, 4); nan if one is."""
    most = 0.0
    for i in range(len(a)):
        for k in range(4):
            size = abs(a[i, k])
            if size > most or size != size:
                most = size
    return most


@njit
def to_edge(s, d, radius):  # type: ignore[no-untyped-def]
    """The first τ ≥ 0 at which some bubble's part of s + τ d is `radius` (m) long."""
    least = np.inf
    for i in range(len(s)):
        dd = sd = ss = 0.0
        for k in range(4):
            dd += d[i, k] * d[i, k]
            sd += s[i, k] * d[i, k]
            ss += s[i, k] * s[i, k]
        if dd > 0.0:
            room = max(radius * radius - ss, 0.0)
            least = min(least, (math.sqrt(sd * sd + dd * room) - sd) / dd)
    return least


@njit
def each_to_edge(d, radius, s):  # type: ignore[no-untyped-def]
    """`s` = `d` with each bubble's part cut to `radius` (m); False if that is all the same as `d`."""
    cut = False
    for i in range(len(d)):
        size = math.sqrt(d[i, 0] ** 2 + d[i, 1] ** 2 + d[i, 2] ** 2 + d[i, 3] ** 2)
        share = 1.0
        if size > radius:
            share, cut = radius / size, True
        for k in range(4):
            s[i, k] = share * d[i, k]
    return cut


@njit
def newton_step(g, at, radius, accuracy, s, work):  # type: ignore[no-untyped-def]
    """Fill `s`, (n, 4) m, by Steihaug's method, each bubble's part no longer than `radius` (m).

    `g` is the gradient (N), `at` the `Curvature`, `accuracy` the share of the residual that may be left, `work` room of
    (4, n, 4). Returns the energy (J) that it should save, whether it ends at the edge, and whether curvature was negative.
    """
    r, z, d, Hd = work[0], work[1], work[2], work[3]
    s[:] = 0.0
    put(r, -1.0, g)
    precondition(at.inverses, r, z)
    put(d, 1.0, z)
    rz = inner(r, z)
    goal = accuracy * accuracy * inner(r, r)
    saved = 0.0
    for k in range(8 * len(g) + 20):
        hessian(d, at.pairs, at.blocks, at.contacts, Hd)
        dHd = inner(d, Hd)
        rd = inner(r, d)
        edge = to_edge(s, d, radius)
        if k == 0 and edge < 1.0 and each_to_edge(d, radius, s):
            # Far from equilibrium one bubble would hold up all others: each goes as far as it may on its own.
            hessian(s, at.pairs, at.blocks, at.contacts, Hd)
            saved = inner(r, s) - 0.5 * inner(s, Hd)
            if saved > 0.0:
                return saved, True, dHd <= 0.0
            s[:] = 0.0
            saved = 0.0
        if dHd <= 0.0 and radius == np.inf:
            return saved, True, True
        if dHd <= 0.0 or rd >= edge * dHd:
            add(s, edge, d)
            return saved + edge * rd - 0.5 * edge * edge * dHd, True, dHd <= 0.0
        alpha = rd / dHd
        add(s, alpha, d)
        add(r, -alpha, Hd)
        saved += alpha * rd - 0.5 * alpha * alpha * dHd
        if inner(r, r) <= goal:
            break
        precondition(at.inverses, r, z)
        new = inner(r, z)
        put(d, new / rz, d)
        add(d, 1.0, z)
        rz = new
    return saved, False, False


@njit
def _place(state, s, bubbles, trial):  # type: ignore[no-untyped-def]
    """`trial` = `state` + `s`; whether its radii are in the model's range, or one closes or grows without end."""
    put(trial, 1.0, state)
    add(trial, 1.0, s)
    closed = False
    for i in range(len(state)):
        bubble = bubbles[i]
        if bubble.outer * _LARGEST < trial[i, 3]:
            return _GROWS
        # The base is hundreds of times stiffer than the neck, which the model of a step from above it cannot know:
        # a bubble that falls through it in this step lands on it.
        if state[i, 2] > state[i, 3] and trial[i, 2] < trial[i, 3]:
            trial[i, 2] = trial[i, 3]
        closed = closed or trial[i, 3] < _SMALLEST * bubble.outer
        closed = closed or trial[i, 3] ** 3 < 1.001 * (bubble.outer**3 - bubble.inner**3)
    return _CLOSES if closed else _IN_RANGE


@njit
def _merit(E, new_E, saved, force, new_force):  # type: ignore[no-untyped-def]
    """Energy saved by a step as a share of what it should save; where rounding hides that, 1 if the force fell, else −1."""
    small = _ROUNDING * (abs(E) + 1e-6)
    if saved <= small:
        return 1.0 if new_force < force and new_E <= E + small else -1.0
    return (E - new_E) / max(saved, small)


@njit
def _relax(state, held, bubbles, springs, pairs, radius, tolerance, trace):  # type: ignore[no-untyped-def]
    n, m, limit = len(state), len(pairs), len(trace) - 1
    g, trial, new_g, s = np.empty((n, 4)), np.empty((n, 4)), np.empty((n, 4)), np.empty((n, 4))
    at = Curvature(pairs, np.empty((n, 4, 4)), np.empty((m, 5)), np.empty((n, 4, 4)))
    work = np.empty((4, n, 4))
    E = gradient(state, held, bubbles, springs, pairs, g)
    trace[0] = E
    force = largest(g)
    first, trust = max(force, tolerance), radius
    ended, unstable, fresh, steps = EXHAUSTED, False, False, 0
    while force > tolerance and steps < limit:
        if not fresh:
            curvature(state, held, bubbles, springs, pairs, at.blocks, at.contacts)
            invert(at.blocks, at.inverses)
            fresh = True
        accuracy = min(0.1, math.sqrt(force / first))
        saved, edge, negative = newton_step(g, at, trust, accuracy, s, work)
        unstable = unstable or negative
        steps += 1
        place = _place(state, s, bubbles, trial)
        ratio = -1.0
        if place == _IN_RANGE:
            new_E = gradient(trial, held, bubbles, springs, pairs, new_g)
            new_force = largest(new_g)
            ratio = _merit(E, new_E, saved, force, new_force)
            if ratio > 0.0 and (ratio > 1e-4 or new_force < force):
                put(state, 1.0, trial)
                put(g, 1.0, new_g)
                E, force, fresh = new_E, new_force, False
        trace[steps] = E
        trust = _next_trust(trust, ratio, edge, radius)
        if place == _GROWS or trust < _LEAST_TRUST:
            ended = STALLED if place == _IN_RANGE else BURST
            break
    for k in range(steps, limit + 1):
        trace[k] = E
    return CONVERGED if force <= tolerance else ended, force, steps, unstable


@njit
def _next_trust(trust, ratio, edge, radius):  # type: ignore[no-untyped-def]
    """The trust region's radius (m) after a step that saved `ratio` of what it should."""
    if ratio < 0.1:
        return 0.25 * trust
    if ratio > 0.75 and edge:
        return min(2.0 * trust, radius)
    return trust


@njit
def _solve(state, held, bubbles, springs, pairs, rhs, out, accuracy):  # type: ignore[no-untyped-def]
    n, m = len(state), len(pairs)
    at = Curvature(pairs, np.empty((n, 4, 4)), np.empty((m, 5)), np.empty((n, 4, 4)))
    work = np.empty((4, n, 4))
    curvature(state, held, bubbles, springs, pairs, at.blocks, at.contacts)
    invert(at.blocks, at.inverses)
    good, g = True, np.empty((n, 4))
    for k in range(len(rhs)):
        put(g, -1.0, rhs[k])
        _, edge, _ = newton_step(g, at, np.inf, accuracy, out[k], work)
        good = good and not edge
    return good


@njit
def _extent(state, last, bubbles):  # type: ignore[no-untyped-def]
    radius = aside = moved = 0.0
    for i in range(len(state)):
        radius = max(radius, state[i, 3])
        aside = max(aside, (state[i, 0] - bubbles[i].x) ** 2 + (state[i, 1] - bubbles[i].y) ** 2)
        distance = 0.0
        for k in range(4):
            distance += (state[i, k] - last[i, k]) ** 2
        moved = max(moved, distance)
    return radius, math.sqrt(aside), math.sqrt(moved)


def _entries(stamp: int):  # type: ignore[no-untyped-def]
    """What is called from Python, compiled and cached on disk.

    numba's cache looks at this file and at what a function closes over, not at the other files that it calls into.
    `stamp` stands for those: without it an edited formula would go on running as it was.
    """

    @njit(cache=True)
    def relax(state, held, bubbles, springs, pairs, radius, tolerance, trace):  # type: ignore[no-untyped-def]
        """Relax `state`, (n, 4) m, in place; `held` as of `gradient`. No step moves a bubble further than `radius` (m).

        `tolerance` (N) is the goal of the largest force; `trace`, (k + 1,), gets the energy (J) after each of at most k
        steps. Returns how it ended, the largest force left (N), the steps taken, and whether curvature was ever negative.
        """
        _ = stamp
        return _relax(state, held, bubbles, springs, pairs, radius, tolerance, trace)

    @njit(cache=True)
    def solve(state, held, bubbles, springs, pairs, rhs, out, accuracy):  # type: ignore[no-untyped-def]
        """`out` = H⁻¹ rhs for k right-hand sides, both (k, n, 4), at a stable equilibrium; False if it is none."""
        _ = stamp
        return _solve(state, held, bubbles, springs, pairs, rhs, out, accuracy)

    @njit(cache=True)
    def evaluate(state, held, bubbles, springs, pairs, out):  # type: ignore[no-untyped-def]
        """`energy.gradient`."""
        _ = stamp
        return gradient(state, held, bubbles, springs, pairs, out)

    @njit(cache=True)
    def hold(radius, bubbles, out):  # type: ignore[no-untyped-def]
        """Pressure `out` (Pa) that holds each free bubble at outer `radius` (m), (n,) each."""
        _ = stamp
        for i in range(len(radius)):
            out[i] = membrane(radius[i], bubbles[i])[1]

    @njit(cache=True)
    def extent(state, last, bubbles):  # type: ignore[no-untyped-def]
        """The largest radius, the furthest aside of a barb, and the furthest that any bubble is from where it was `last`: m."""
        _ = stamp
        return _extent(state, last, bubbles)

    return relax, solve, evaluate, hold, extent


_FILES = (balloon, wall, energy)
relax, solve, evaluate, hold, extent = _entries(zlib.crc32("".join(map(inspect.getsource, _FILES)).encode()))
