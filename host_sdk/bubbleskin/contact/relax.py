"""Down to the nearest equilibrium: Newton steps by conjugate gradients, within a trust region, compiled.

Steihaug's method: conjugate gradients on H s = −g, preconditioned by each bubble's own 4 by 4 block, until the residual
is small enough, the step leaves the trust region, or the curvature is negative: then the step follows that direction
to the region's edge. So a saddle is left downhill, a step never raises the energy, and work is linear in contacts.
"""

import inspect
import math
import zlib

import numpy as np
from numba import njit

from bubbleskin.contact import energy
from bubbleskin.contact.energy import curvature, gradient, hessian, membrane
from bubbleskin.membrane import balloon, wall

CONVERGED, STALLED, EXHAUSTED, BURST = range(4)
"""How a relaxation ends: force below tolerance; no step helps; too many steps; a bubble grows without end or closes."""

_ROUNDING = 1e-14  # of the energy: below that, the forces decide whether a step is good
_LARGEST, _SMALLEST = 10.0, 0.4  # stretches


@njit
def invert(blocks, inverses):  # type: ignore[no-untyped-def]
    """Inverse of each block's positive part, by Cholesky with pivots held up."""
    L = np.zeros((4, 4))
    y = np.zeros(4)
    for i in range(len(blocks)):
        B = blocks[i]
        floor = 1e-3 * max(abs(B[0, 0]), abs(B[1, 1]), abs(B[2, 2]), abs(B[3, 3]))
        for a in range(4):
            for b in range(a):
                total = B[a, b]
                for c in range(b):
                    total -= L[a, c] * L[b, c]
                L[a, b] = total / L[b, b]
            total = B[a, a]
            for c in range(a):
                total -= L[a, c] * L[a, c]
            L[a, a] = math.sqrt(max(total, floor))
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
def precondition(inverses, r, z):  # type: ignore[no-untyped-def]
    """`z` = the inverted blocks times `r`, both (n, 4)."""
    for i in range(len(r)):
        for a in range(4):
            M = inverses[i, a]
            z[i, a] = M[0] * r[i, 0] + M[1] * r[i, 1] + M[2] * r[i, 2] + M[3] * r[i, 3]


@njit
def inner(a, b):  # type: ignore[no-untyped-def]
    """Sum of a b."""
    total = 0.0
    for i in range(len(a)):
        for k in range(4):
            total += a[i, k] * b[i, k]
    return total


@njit
def to_edge(s, d, radius):  # type: ignore[no-untyped-def]
    """The first τ ≥ 0 at which some bubble's part of s + τ d is `radius` long."""
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
    """`s` = `d` with each bubble's part cut to `radius`; False if that is all the same as `d`."""
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
def newton_step(g, pairs, blocks, contacts, inverses, radius, accuracy, s, work):  # type: ignore[no-untyped-def]
    """Fill `s` by Steihaug's method, each bubble's part no longer than `radius`.

    Returns the energy that it should save, whether it ends at the edge, and whether curvature was negative.
    """
    r, z, d, Hd = work[0], work[1], work[2], work[3]
    s[:] = 0.0
    r[:] = -g
    precondition(inverses, r, z)
    d[:] = z
    rz = inner(r, z)
    goal = accuracy * accuracy * inner(r, r)
    saved = 0.0
    for k in range(8 * len(g) + 20):
        hessian(d, pairs, blocks, contacts, Hd)
        dHd = inner(d, Hd)
        rd = inner(r, d)
        edge = to_edge(s, d, radius)
        if k == 0 and edge < 1.0 and each_to_edge(d, radius, s):
            # Far from equilibrium one bubble would hold up all others: each goes as far as it may on its own.
            hessian(s, pairs, blocks, contacts, Hd)
            saved = inner(r, s) - 0.5 * inner(s, Hd)
            if saved > 0.0:
                return saved, True, dHd <= 0.0
            s[:] = 0.0
            saved = 0.0
        if dHd <= 0.0 and radius == np.inf:
            return saved, True, True
        if dHd <= 0.0 or rd >= edge * dHd:
            s += edge * d
            return saved + edge * rd - 0.5 * edge * edge * dHd, True, dHd <= 0.0
        alpha = rd / dHd
        s += alpha * d
        r -= alpha * Hd
        saved += alpha * rd - 0.5 * alpha * alpha * dHd
        if inner(r, r) <= goal:
            break
        precondition(inverses, r, z)
        new = inner(r, z)
        d[:] = z + (new / rz) * d
        rz = new
    return saved, False, False


def _compile(stamp: int):  # type: ignore[no-untyped-def]
    """Compile what is called from Python; `stamp` stands for the files that numba's cache cannot see, as in `sim.kernel`."""

    @njit(cache=True)
    def relax(state, pressure, bubbles, springs, pairs, radius, tolerance, limit, trace):  # type: ignore[no-untyped-def]
        """Relax `state` in place at `pressure`; no step moves a bubble further than `radius` (m).

        Returns how it ended, the largest force left (N), the steps taken, and whether curvature was ever negative.
        `tolerance` is that force's goal, `limit` the most steps; `trace`, (limit + 1,), gets the energy after each.
        """
        _ = stamp
        n, m = len(state), len(pairs)
        g, trial, new_g, s = np.empty((n, 4)), np.empty((n, 4)), np.empty((n, 4)), np.empty((n, 4))
        blocks, inverses, contacts = np.empty((n, 4, 4)), np.empty((n, 4, 4)), np.empty((m, 5))
        work = np.empty((4, n, 4))
        E = gradient(state, pressure, bubbles, springs, pairs, g)
        trace[0] = E
        force = np.abs(g).max()
        trust = radius
        first = max(force, tolerance)
        unstable = fresh = False
        steps = 0
        while force > tolerance and steps < limit:
            if not fresh:
                curvature(state, pressure, bubbles, springs, pairs, blocks, contacts)
                invert(blocks, inverses)
                fresh = True
            accuracy = min(0.1, math.sqrt(force / first))
            saved, edge, negative = newton_step(g, pairs, blocks, contacts, inverses, trust, accuracy, s, work)
            unstable = unstable or negative
            trial[:] = state + s
            steps += 1
            closed = False
            for i in range(n):
                if bubbles[i].outer * _LARGEST < trial[i, 3]:
                    trace[steps:] = E
                    return BURST, force, steps, unstable
                # The base is hundreds of times stiffer than the neck, which the model of a step from above it cannot know:
                # who falls through it in this step lands on it.
                if state[i, 2] > state[i, 3] and trial[i, 2] < trial[i, 3]:
                    trial[i, 2] = trial[i, 3]
                closed = closed or trial[i, 3] < _SMALLEST * bubbles[i].outer
                closed = closed or trial[i, 3] ** 3 < 1.001 * (bubbles[i].outer ** 3 - bubbles[i].inner ** 3)
            if closed:
                trust *= 0.25
                trace[steps] = E
                if trust < 1e-12:
                    trace[steps:] = E
                    return BURST, force, steps, unstable
                continue
            new_E = gradient(trial, pressure, bubbles, springs, pairs, new_g)
            new_force = np.abs(new_g).max()
            small = _ROUNDING * (abs(E) + 1e-6)
            ratio = (E - new_E) / max(saved, small)
            if saved <= small:
                ratio = 1.0 if new_force < force and new_E <= E + small else -1.0
            if ratio > 0.0 and (ratio > 1e-4 or new_force < force):
                state[:] = trial
                g[:] = new_g
                E, force, fresh = new_E, new_force, False
            trace[steps] = E
            if ratio < 0.1:
                trust *= 0.25
                if trust < 1e-13:
                    trace[steps:] = E
                    return STALLED, force, steps, unstable
            elif ratio > 0.75 and edge:
                trust = min(2.0 * trust, radius)
        trace[steps:] = E
        return CONVERGED if force <= tolerance else EXHAUSTED, force, steps, unstable

    @njit(cache=True)
    def solve(state, pressure, bubbles, springs, pairs, rhs, out, accuracy):  # type: ignore[no-untyped-def]
        """`out` = H⁻¹ rhs for k right-hand sides, both (k, n, 4), at a stable equilibrium; False if it is none."""
        _ = stamp
        n, m = len(state), len(pairs)
        blocks, inverses, contacts = np.empty((n, 4, 4)), np.empty((n, 4, 4)), np.empty((m, 5))
        work = np.empty((4, n, 4))
        curvature(state, pressure, bubbles, springs, pairs, blocks, contacts)
        invert(blocks, inverses)
        good = True
        for k in range(len(rhs)):
            _, edge, _ = newton_step(-rhs[k], pairs, blocks, contacts, inverses, np.inf, accuracy, out[k], work)
            good = good and not edge
        return good

    @njit(cache=True)
    def evaluate(state, pressure, bubbles, springs, pairs, out):  # type: ignore[no-untyped-def]
        """`energy.gradient`, cached."""
        _ = stamp
        return gradient(state, pressure, bubbles, springs, pairs, out)

    @njit(cache=True)
    def hold(radius, bubbles, out):  # type: ignore[no-untyped-def]
        """Pressure (Pa) that holds each free bubble at outer `radius`, (n,)."""
        _ = stamp
        for i in range(len(radius)):
            out[i] = membrane(radius[i], bubbles[i])[1]

    @njit(cache=True)
    def extent(state, last, bubbles):  # type: ignore[no-untyped-def]
        """The largest radius, the furthest aside of a barb, and the furthest that any bubble is from where it was `last`."""
        _ = stamp
        radius = aside = moved = 0.0
        for i in range(len(state)):
            radius = max(radius, state[i, 3])
            aside = max(aside, (state[i, 0] - bubbles[i].x) ** 2 + (state[i, 1] - bubbles[i].y) ** 2)
            distance = 0.0
            for k in range(4):
                distance += (state[i, k] - last[i, k]) ** 2
            moved = max(moved, distance)
        return radius, math.sqrt(aside), math.sqrt(moved)

    return relax, solve, evaluate, hold, extent


_FILES = (balloon, wall, energy)
relax, solve, evaluate, hold, extent = _compile(zlib.crc32("".join(map(inspect.getsource, _FILES)).encode()))
